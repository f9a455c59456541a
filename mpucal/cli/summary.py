"""What a person wants to know of a calibration first, in the units people use."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..report.units import accelerometer, with_std
from ..report.use import left_to_subtract
from ..result.calibration import ACCELEROMETER_FORMULA, GOOD, REFUSED, USABLE, Calibration
from ..result.session_files import BLOB, DOCUMENT, REPORT

AXES = "xyz"
# what fits a terminal of 80 columns
WIDTH, LABEL, COLUMN = 79, 16, 20
SENTENCES = {
    GOOD: "The calibration is good.",
    USABLE: "The calibration is usable, with reservations:",
    REFUSED: "The calibration is refused:",
}


def summary(calibration: Calibration) -> str:
    """The verdict in a sentence, its reasons, what was found and how sure that is."""
    lines = []
    if "verdict" in calibration.quality:
        reasons = calibration.quality.get("reasons", [])
        lines = [SENTENCES[calibration.verdict], *(_reason(reason["message"]) for reason in reasons), ""]
    return "\n".join([*lines, *_parameters(calibration), *_magnitudes(calibration), *_fit(calibration)])


def written(paths: Sequence[Path]) -> str:
    """The files, and what to do with them."""
    folder = paths[0].parent
    lines = [f"Written to {folder}:", "  " + ", ".join(path.name for path in paths)]
    if any(path.name == BLOB.name for path in paths):
        lines += [
            "Next:",
            f"  look at      {folder / REPORT.name}",
            f'  in Python    a = mpucal.Calibration.load("{folder / DOCUMENT.name}").apply(acc)',
            f"  in firmware  {folder / BLOB.name}, as firmware_protocol.md describes it",
        ]
    else:
        lines += [f"Next: look at {folder / REPORT.name}, mend what is named above, and run the session again."]
    return "\n".join(lines)


def formula(calibration: Calibration) -> str:
    """The calibrated acceleration, with its numbers."""
    rows = [
        f"  [{' '.join(f'{value:+.6f}' for value in row)}]   y_{axis} {-bias:+.5f}"
        for axis, row, bias in zip(AXES, np.linalg.inv(calibration.D), left_to_subtract(calibration), strict=True)
    ]
    return "\n".join([f"{ACCELEROMETER_FORMULA} [m/s²]", *rows])


def _reason(message: str) -> str:
    return textwrap.fill(f"  - {message}.", WIDTH, subsequent_indent="    ")


def _parameters(c: Calibration) -> list[str]:
    """Gain, bias, and how much each axis leans towards the other two; one column an axis."""
    lines = [f"{'':<{LABEL}}" + "".join(f"{axis:>{COLUMN}}" for axis in AXES)]
    for row in accelerometer(c):
        cells = [
            "" if row.name == f"lean to {axis}" else with_std(float(row.value[i]), float(row.std[i]))
            for i, axis in enumerate(AXES)
        ]
        lines.append(
            (f"{f'{row.name}, {row.unit}':<{LABEL}}" + "".join(f"{cell:>{COLUMN}}" for cell in cells)).rstrip()
        )
    return lines


def _magnitudes(calibration: Calibration) -> list[str]:
    before, after = (calibration.quality.get(f"magnitude_{when}") for when in ("before", "after"))
    if not before or not after:
        return []
    rows = [("before", before), ("after", after)]
    return ["", *(f"|a| {when:<7}{_statistics(row)}" for when, row in rows)]


def _statistics(row: Mapping[str, float | None]) -> str:
    median, std = (_number(row.get(key)) for key in ("median", "std"))
    return f"{median:7.3f} m/s² in the median, spread {std:.3f}"


def _fit(calibration: Calibration) -> list[str]:
    fit = calibration.fit
    if "samples" not in fit:
        return []
    return [
        "",
        f"Model {fit.get('model')}: {fit['samples']} samples in {_number(fit.get('seconds')):.1f} s,"
        f" gravity {_number(fit.get('gravity')):.5f} m/s².",
    ]


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
