"""The page of a fleet: distributions of parameters, outliers, and repeatability of sensors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from ..data import Vector
from ..report.elements import document, escape, figure, paragraph, section, table
from ..report.figure import BEFORE, Axes, X, Y, Z
from ..result.calibration import GOOD, REFUSED, USABLE
from .fleet import OUTLIER_STD, Parameter, parameters, repeatability, repeated_sensors

PAGE = "fleet.html"
# rows of a table on the page; results.csv has all
MOST_ROWS = 200
Columns = Mapping[str, Sequence[Any]]


def make_page(results: Path) -> tuple[str, str]:
    """Return the page of results.parquet, and its first sentence."""
    columns: Columns = pq.read_table(results).to_pydict()
    found = parameters(columns)
    sentence = _sentence(columns)
    body = (
        paragraph(sentence),
        _yield(columns),
        _distributions(found),
        _outliers(columns, found),
        _groups("By batch", "batch", columns["batch"], columns, found),
        _groups("By date", "date", [each and each[:10] for each in columns["recorded"]], columns, found),
        _temperature(columns),
        _repeats(columns),
        _errors(columns),
        _reports(columns),
    )
    count = len(columns["path"])
    return document(f"Fleet of {count}", f"{count} recordings", *body), sentence


def _sentence(columns: Columns) -> str:
    counts = Counter(columns["verdict"])
    unread = sum(error is not None for error in columns["error"])
    verdicts = [f"{counts[verdict]} {verdict}" for verdict in (GOOD, USABLE, REFUSED)]
    return f"Of {len(columns['path'])} recordings, {', '.join(verdicts)}, {unread} could not be read."


def _yield(columns: Columns) -> str:
    n = max(len(columns["path"]), 1)
    by_verdict = Counter(verdict or "not read" for verdict in columns["verdict"])
    verdicts = [(name, str(count), f"{100 * count / n:.1f} %") for name, count in by_verdict.most_common()]
    by_reason = Counter(
        (code, verdict or "")
        for codes, verdict in zip(columns["reasons"], columns["verdict"], strict=True)
        for code in (codes or "").split()
    )
    reasons = [
        (code, verdict, str(count), f"{100 * count / n:.1f} %") for (code, verdict), count in by_reason.most_common()
    ]
    return section(
        "Yield",
        table("verdicts", "", ("verdict", "recordings", "share"), verdicts),
        table("reasons", "Reasons against them", ("reason", "verdict", "recordings", "share"), reasons)
        if reasons
        else "",
    )


def _distributions(found: Iterable[Parameter]) -> str:
    rows = []
    for each in found:
        if len(each.known):
            low, high = np.percentile(each.known, (5, 95))
            median, spread = each.middle
            limits = each.limit[np.isfinite(each.limit)]
            limit = f"±{limits.max():.3g}" if len(limits) else "unknown"
            numbers = [f"{x:+.3f}" for x in (low, median, high)]
            rows.append((f"{each.name}, {each.unit}", *numbers, f"{spread:.3f}", limit, str(each.beyond)))
    if not rows:
        return ""
    head = ("parameter", "5 %", "median", "95 %", "spread", "data sheet", "beyond it")
    note = "Spread: standard deviation from the median absolute deviation. Refused calibrations are left out."
    pictures = [figure(_histograms(found, prefix), f"{prefix} of all boards") for prefix in ("scale factor", "bias")]
    return section("Parameters", table("parameters", note, head, rows), *pictures)


def _histograms(found: Iterable[Parameter], prefix: str) -> str:
    some = [each for each in found if each.name.startswith(prefix) and len(each.known) > 1]
    if not some:
        return ""
    limits = np.unique(np.concatenate([each.limit[np.isfinite(each.limit)] for each in some]))
    values = np.concatenate([*(each.known for each in some), limits, -limits])
    edges = np.histogram_bin_edges(values, 40)
    counts = [np.histogram(each.known, edges)[0] for each in some]
    most = 1.05 * float(np.max(counts))
    axes = Axes((float(edges[0]), float(edges[-1])), (0.0, most), f"[{some[0].unit}]", "boards")
    at = np.repeat(edges, 2)[1:-1]
    lines = [axes.line(at, np.repeat(count, 2), colour) for count, colour in zip(counts, (X, Y, Z), strict=False)]
    for limit in (*limits, *-limits):
        lines.append(axes.line(np.array([limit, limit]), np.array([0.0, most]), BEFORE))
    sheet = (("data sheet", BEFORE),) if len(limits) else ()
    named = [(each.name[-1], colour) for each, colour in zip(some, (X, Y, Z), strict=False)]
    return axes.svg(prefix.replace(" ", "-"), f"histograms: {prefix} of x, y and z", lines, *named, *sheet)


def _outliers(columns: Columns, found: Iterable[Parameter]) -> str:
    far = [
        (away, (columns["path"][i], each.name, f"{each.value[i]:+.3f} {each.unit}", f"{away:.1f}"))
        for each in found
        for i, away in each.outliers()
    ]
    rows = [row for _, row in sorted(far, key=lambda item: -item[0])]
    caption = f"More than {OUTLIER_STD:g} spreads from the median"
    if len(rows) > MOST_ROWS:
        caption += f"; the farthest {MOST_ROWS} of {len(rows)}"
    head = ("recording", "parameter", "value", "spreads away")
    return section(
        "Outliers", table("outliers", caption, head, rows[:MOST_ROWS], links=_links(columns)) if rows else ""
    )


def _groups(title: str, what: str, names: Sequence[str | None], columns: Columns, found: Sequence[Parameter]) -> str:
    """Return the medians of each named group."""
    groups = sorted({name for name in names if name})
    if len(groups) < 2:
        return ""
    key, verdict = np.array([name or "" for name in names]), np.array([each or "" for each in columns["verdict"]])
    rows = []
    for group in groups[:MOST_ROWS]:
        inside = key == group
        good = f"{100 * np.mean(verdict[inside] == 'good'):.0f} %"
        medians = (_median(each.value[inside]) for each in found)
        rows.append((group, str(int(inside.sum())), good, *medians))
    head = (what, "recordings", "good", *(f"{each.name}, {each.unit}" for each in found))
    return section(title, table(f"by-{what}", "Medians", head, rows))


def _median(values: Vector) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):+.3f}" if len(known) else ""


def _temperature(columns: Columns) -> str:
    T = np.array(columns["temperature_c"], float)
    warm = T[np.isfinite(T)]
    if not len(warm):
        return ""
    range_c = f"Recorded at {warm.min():.1f} to {warm.max():.1f} °C, median {np.median(warm):.1f} °C."
    return section("Temperature", paragraph(range_c))


def _repeats(columns: Columns) -> str:
    pairs = repeated_sensors(columns)
    if not pairs:
        return ""
    rows = []
    for name, far in repeatability(columns, pairs):
        known = far[np.isfinite(far)]
        if len(known):
            rows.append(
                (name, str(len(known)), f"{np.sqrt(np.mean(known**2)):.2f}", f"{100 * np.mean(abs(known) > 2):.1f} %")
            )
    intro = f"{len(pairs)} pairs of recordings are of one sensor each, by the factory trim in its offset registers."
    head = ("elements of", "differences", "rms, in standard deviations", "beyond 2")
    note = "If nothing changed, the rms is 1, and 4.6 % are beyond 2."
    return section("Repeatability", paragraph(intro), table("repeats", note, head, rows))


def _errors(columns: Columns) -> str:
    rows = [(path, error) for path, error in zip(columns["path"], columns["error"], strict=True) if error]
    caption = f"The first {MOST_ROWS} of {len(rows)}" if len(rows) > MOST_ROWS else ""
    head = ("recording", "why")
    return section("Not read", table("errors", caption, head, rows[:MOST_ROWS], words=0) if rows else "")


def _reports(columns: Columns) -> str:
    verdicts, links = dict(zip(columns["path"], columns["verdict"], strict=True)), _links(columns)
    items = [
        f'<li><a href="{escape(place)}">{escape(path)}</a>: {escape(verdicts[path] or "")}</li>\n'
        for path, place in links.items()
    ]
    return section("Reports", f"<ul>{''.join(items)}</ul>\n") if items else ""


def _links(columns: Columns) -> dict[str, str]:
    """Return recording -> its report."""
    pairs = zip(columns["path"], columns["report"], strict=True)
    return {path: f"reports/{report}" for path, report in pairs if report}
