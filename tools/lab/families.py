"""Is a verdict true? Simulated hands and sensors of many kinds, calibrated and compared with what they are.

python -m tools.lab families --seeds 0:6
python -m tools.lab families --families 'poses*,continuous' --seeds 0:33 --workers 2 --json families.json

A family is a row of worlds/table.py; worlds/judge.py says what is false, and which limits there are. Seeds
0 to 32 are for development: limits and constants are set on them. Seeds 4000 to 4032 are for reports, and nothing is
set on what they show; tests have 100 and 101. The exit code is 1 where a limit is broken.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
from collections.abc import Sequence
from dataclasses import asdict
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path

from mpucal.session.threads import ONE_THREAD

os.environ.update(ONE_THREAD)  # before NumPy loads, here and in the workers

from rich.console import Console
from rich.progress import track
from rich.table import Table

from .worlds.family import Family, Wanted
from .worlds.judge import RMS_Z, Count, Run, beside, broken, count, judged
from .worlds.table import FAMILIES


def one(item: tuple[str, int], model: str) -> Run:
    """A family's name and a seed, judged."""
    name, seed = item
    return judged(FAMILIES[name], seed, model)


def all_of(families: Sequence[Family], seeds: Sequence[int], model: str, workers: int) -> list[Run]:
    """Every seed of every family, on so many processes."""
    items = [(family.name, seed) for family in families for seed in seeds]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        runs = pool.imap(partial(one, model=model), items)
        return list(track(runs, "families", len(items), console=Console(stderr=True), transient=True))


def number(value: float) -> str:
    """Two digits; nothing where there is no number."""
    return "" if math.isnan(value) else f"{value:.2g}" if value < 100 else f"{value:.0f}"


def cells(of: Count) -> list[str]:
    """A line's numbers."""
    reasons = ", ".join(f"{code} {n}" for code, n in list(of.reasons.items())[:3])
    verdicts = (of.good, of.usable, of.refused + of.crashed, of.false_good, of.false_usable)
    values = (of.rms_z, of.max_z, of.error, of.claim, of.worst_good)
    return [*(str(n) if n else "" for n in verdicts), *(number(v) for v in values), reasons]


def table(families: Sequence[Family], runs: Sequence[Run]) -> Table:
    """A line for each family, and one for all."""
    lines = Table("family", "wanted", title=f"{len(runs)} calibrations; errors in m/s², rms over the sphere")
    for column in "good", "usable", "refused", "false\ngood", "false\nusable", "rms z", "max z":
        lines.add_column(column, justify="right")
    for column in "median\nerror", "median\nclaim", "worst\ngood":
        lines.add_column(column, justify="right")
    lines.add_column("reasons")
    for family in families:
        of = [run for run in runs if run.family == family.name]
        wanted = "" if family.wanted is Wanted.HONEST else family.wanted.value
        lines.add_row(family.name, wanted, *cells(count(of)))
    lines.add_section()
    lines.add_row("all", "", *cells(count(runs)))
    return lines


def chosen(patterns: str | None) -> list[Family]:
    """The families whose names match one of these, with commas between them; all without.

    Raises
    ------
    ValueError : a pattern that matches none.
    """
    if patterns is None:
        return list(FAMILIES.values())
    for pattern in patterns.split(","):
        if not any(fnmatchcase(name, pattern) for name in FAMILIES):
            raise ValueError(f"no family is called {pattern!r}; they are: {', '.join(FAMILIES)}")
    return [f for name, f in FAMILIES.items() if any(fnmatchcase(name, p) for p in patterns.split(","))]


def seeds_of(text: str) -> range:
    """FIRST:END, or one seed."""
    first, colon, end = text.partition(":")
    return range(int(first), int(end) if colon else int(first) + 1)


def main() -> int:
    """Judge, print and save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--families", help="names or patterns of names, with commas between them")
    parser.add_argument("--seeds", type=seeds_of, default=range(6), help="FIRST:END, such as 0:33 or 4000:4033")
    parser.add_argument("--model", default="auto")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write every run to this file")
    options = parser.parse_args()
    try:
        families = chosen(options.families)
    except ValueError as error:
        parser.error(str(error))
    runs = all_of(families, options.seeds, options.model, options.workers)
    # as wide as its content, whatever the terminal
    console = Console(width=170)
    console.print(table(families, runs))
    odd = ", ".join(f"{name} {number(z)}" for name, z in beside(families, runs).items())
    console.print(f"rms z outside {RMS_Z[0]}..{RMS_Z[1]}: {odd or 'none'}", highlight=False)
    limits = broken(families, runs)
    console.print("\n".join(f"BROKEN {limit}" for limit in limits) or "every limit is kept", highlight=False)
    if options.json:
        document = {"seeds": [*options.seeds], "broken": limits, "runs": [{**asdict(r), "z": r.z} for r in runs]}
        text = json.dumps(document, indent=1).replace("NaN", "null").replace("Infinity", "null")
        options.json.write_text(text + "\n", encoding="utf-8")
    return 1 if limits else 0
