"""`mpucal diff`: compare two calibrations, and say whether the difference is significant."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ..report.units import with_std
from ..result.comparison import CONFIDENCE, Comparison, Difference, compare
from .loading import loaded

EXAMPLE = "Example: `mpucal diff board7/calibration.json board7-today/calibration.json`"


@click.command("diff", epilog=EXAMPLE)
@click.argument("a", metavar="A", type=click.Path(path_type=Path))
@click.argument("b", metavar="B", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(a: Path, b: Path, as_json: bool) -> None:
    """Compare calibration B (.json or .bin) with A: bias in mg, scale factor error in %, misalignment in deg.

    Two good calibrations of one unchanged sensor are called different in 1 of 100 cases. If one of them is usable with
    reservations, its uncertainties may be too small, and a small difference is reported as undecided.
    """
    found = compare(loaded(a), loaded(b))
    click.echo(json.dumps(_document(found), indent=2) if as_json else _page(found))


def _document(found: Comparison) -> dict[str, Any]:
    return {
        "same": found.same,
        "confidence": CONFIDENCE,
        "limit": found.limit,
        "margin": found.margin,
        "numbers": [_plain(d) for d in found.numbers],
        "gyroscope": [_plain(d) for d in found.gyroscope],
        "remarks": list(found.remarks),
    }


def _plain(d: Difference) -> dict[str, Any]:
    # NaN, which equals nothing, is null
    return {key: None if value != value else value for key, value in {**asdict(d), "z": d.z}.items()}  # noqa: PLR0124


def _page(found: Comparison) -> str:
    rows = [
        f"  {f'{d.name}, {d.unit}':<26}{with_std(d.value, d.std):>22}{_stars(d, found.limit)}"
        for d in (*found.numbers, *found.gyroscope)
    ]
    return "\n".join([_verdict(found), "", *rows, *(["", *found.remarks] if found.remarks else [])])


def _stars(d: Difference, limit: float) -> str:
    return f"   {abs(d.z):.1f} standard deviations" if abs(d.z) > limit else ""


def _verdict(found: Comparison) -> str:
    if found.same:
        return "The same: no parameter of the accelerometer differs by more than the combined uncertainty."
    apart = found.changed or found.doubtful
    if not apart:
        return "Undecided: a calibration has no uncertainties (a config blob never has)."
    said = "Different" if found.changed else "Undecided"
    return (
        f"{said}: {len(apart)} of the accelerometer's parameters changed by more than the combined uncertainty,\n"
        f"most significantly {apart[0].name}, by {apart[0].value:+.3g} {apart[0].unit}"
        f"{'.' if found.changed else ', but the uncertainties may be too small.'}"
    )
