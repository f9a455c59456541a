"""`mpucal diff`: compare two calibrations, and say whether the difference is significant."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ..result.comparison import CONFIDENCE, Comparison, compare
from ..result.document import plain
from ..result.error_model import with_std
from .common import CALIBRATION_PATH, json_option, load_calibration

EXAMPLE = "Example: `mpucal diff board7/calibration.json board7-today/calibration.json`"


@click.command("diff", epilog=EXAMPLE)
@click.argument("a", metavar="A", type=CALIBRATION_PATH)
@click.argument("b", metavar="B", type=CALIBRATION_PATH)
@json_option("Print JSON.")
def command(a: Path, b: Path, as_json: bool) -> None:
    """Compare calibration B (.json or .bin) with A: bias in mg, scale factor error in %, misalignment in deg.

    Two good calibrations of one unchanged sensor are called different in 1 of 100 cases at most. If one of them is
    usable with reservations, its uncertainties may be too small, and a small difference is reported as undecided.
    """
    comparison = compare(load_calibration(a), load_calibration(b))
    click.echo(json.dumps(_document(comparison), indent=2) if as_json else _page(comparison))


def _document(comparison: Comparison) -> dict[str, Any]:
    return {
        "same": comparison.same,
        "confidence": CONFIDENCE,
        "limit": comparison.limit,
        "margin": comparison.margin,
        "numbers": [plain({**asdict(d), "z": d.z}) for d in comparison.numbers],
        "gyroscope": [plain({**asdict(d), "z": d.z}) for d in comparison.gyroscope],
        "remarks": list(comparison.remarks),
    }


def _page(comparison: Comparison) -> str:
    lines = [_verdict(comparison), ""]
    for d in (*comparison.numbers, *comparison.gyroscope):
        far = f"   {abs(d.z):.1f} standard deviations" if abs(d.z) > comparison.limit else ""
        lines.append(f"  {f'{d.name}, {d.unit}':<26}{with_std(d.value, d.std):>22}{far}")
    return "\n".join([*lines, *(["", *comparison.remarks] if comparison.remarks else [])])


def _verdict(comparison: Comparison) -> str:
    if comparison.same:
        return "The same: no parameter of the accelerometer differs by more than the combined uncertainty."
    different = comparison.changed or comparison.doubtful
    if not different:
        return "Undecided: a calibration has no uncertainties (a config blob never has)."
    verdict, worst = "Different" if comparison.changed else "Undecided", different[0]
    count = f"{len(different)} parameter{'s' if len(different) > 1 else ''}"
    return (
        f"{verdict}: {count} of the accelerometer changed by more than the combined uncertainty,\n"
        f"most significantly {worst.name}, by {worst.value:+.3g} {worst.unit}"
        f"{'.' if comparison.changed else ', but the uncertainties may be too small.'}"
    )
