"""What a person wants to know of a calibration first, in the units people use."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2
from ..result import ACCELEROMETER_FORMULA, GOOD, REFUSED, USABLE, Calibration
from ..sinks.file import BLOB, DOCUMENT, REPORT

AXES = "xyz"
WIDTH = 100
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
    if any(path.name == BLOB for path in paths):
        lines += [
            "Next:",
            f"  look at      {folder / REPORT}",
            f'  in Python    a = mpucal.Calibration.load("{folder / DOCUMENT}").apply(acc)',
            f"  in firmware  {folder / BLOB}, as firmware_protocol.md describes it",
        ]
    else:
        lines += [f"Next: look at {folder / REPORT}, mend what is named above, and run the session again."]
    return "\n".join(lines)


def formula(calibration: Calibration) -> str:
    """The calibrated acceleration, with its numbers."""
    rows = [
        f"  [{' '.join(f'{value:+.6f}' for value in row)}]   y_{axis} {-bias:+.5f}"
        for axis, row, bias in zip(AXES, np.linalg.inv(calibration.D), calibration.b_a, strict=True)
    ]
    return "\n".join([f"{ACCELEROMETER_FORMULA} [m/s²]", *rows])


def _reason(message: str) -> str:
    return textwrap.fill(f"  - {message}.", WIDTH, subsequent_indent="    ")


def _parameters(c: Calibration) -> list[str]:
    """One row an axis: gain, bias, and how much the axis leans towards the other two."""
    gain, gain_sd = 100.0 * (np.diag(c.D) - 1.0), 100.0 * np.diag(c.D_std)
    bias, bias_sd = (1000.0 * v / STANDARD_GRAVITY_MPS2 for v in (c.b_a, c.b_a_std))
    lean, lean_sd = (np.degrees(v / np.diag(c.D)[:, None]) for v in (c.D, c.D_std))
    heads = ["gain error [%]", "bias [mg]", *(f"lean to {axis} [deg]" for axis in AXES)]
    lines = ["axis" + "".join(f"{head:>19}" for head in heads)]
    for i, axis in enumerate(AXES):
        cells = [_cell(gain[i], gain_sd[i]), _cell(bias[i], bias_sd[i])]
        cells += ["" if j == i else _cell(lean[i, j], lean_sd[i, j]) for j in range(3)]
        lines.append((f"{axis:<4}" + "".join(f"{cell:>19}" for cell in cells)).rstrip())
    return lines


def _cell(value: float, sd: float) -> str:
    """value ± sd, to two digits of sd."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(sd) or sd <= 0.0:
        return f"{value:+.3f} ± ?"
    digits = min(max(1 - math.floor(math.log10(sd)), 0), 5)
    return f"{value:+.{digits}f} ± {sd:.{digits}f}"


def _magnitudes(calibration: Calibration) -> list[str]:
    before, after = (calibration.quality.get(f"magnitude_{when}") for when in ("before", "after"))
    if not before or not after:
        return []
    rows = [("before", before), ("after", after)]
    return ["", *(f"|a| {when:<7}{_statistics(row)}" for when, row in rows)]


def _statistics(row: Mapping[str, float | None]) -> str:
    mean, std = (_number(row.get(key)) for key in ("mean", "std"))
    return f"{mean:7.3f} m/s², spread {std:.3f}"


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
