"""The sections on the parameters: both sensors in %, mg and deg, the formula, the verification, the matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result.calibration import Calibration
from ..result.document import ACCELEROMETER_FORMULA, GYROSCOPE_FORMULA
from ..result.orientation import side_down
from .elements import code, number, paragraph, section, table
from .units import AXES, ParameterRow, gyroscope, with_std
from .usual import CAPTION, about, accelerometer_table, compared

NO_FORMULA = "D cannot be inverted: no correction is possible."
UNOBSERVABLE = " ± ?: not observable from this recording."


def is_regular(c: Calibration) -> bool:
    """Whether D and b_a are known, and D can be inverted."""
    known = np.isfinite(c.D).all() and np.isfinite(c.b_a).all()
    return bool(known and np.linalg.matrix_rank(c.D) == 3)


def accelerometer_section(c: Calibration) -> str:
    """The errors of the accelerometer, with their uncertainties."""
    return section("The accelerometer", compared(c), accelerometer_table(c, "accelerometer"), about(c))


def formula(c: Calibration) -> str:
    """The formula that corrects it."""
    if not is_regular(c):
        return paragraph(NO_FORMULA, "formula", note=True)
    said = paragraph(f"{ACCELEROMETER_FORMULA}, in m/s², with y the output of the sensor at its nominal scale factor:")
    applied = ""
    if np.any(c.applied_in_hardware):
        applied = paragraph(
            "The chip's offset registers subtract a part of b_a already; the formula subtracts the rest.",
            note=True,
        )
    return said + code(_formula(c), "formula") + applied


def _formula(c: Calibration) -> str:
    """a = inv(D) (y - b_a), one line an axis."""
    inv_D, bias = c.inverse, c.b_a_to_subtract
    rows = (
        " ".join(
            f"{factor:+.6f} * (y_{of} {-offset:+.6f})" for factor, of, offset in zip(row, "xyz", bias, strict=True)
        )
        for row in inv_D
    )
    return "\n".join(f"a_{axis} = {row}" for axis, row in zip("xyz", rows, strict=True))


def gyroscope_table(c: Calibration) -> str:
    """The errors of the gyroscope, as far as they were estimated."""
    estimated = np.isfinite(c.K_std).any()
    rows = gyroscope(c)
    if not estimated:
        rows = [row for row in rows if row.name == "bias"]
    said = (
        f"Estimated together with the accelerometer.{'' if np.isfinite(c.K_std).all() else UNOBSERVABLE}"
        if estimated
        else "Scale factor errors and misalignments were taken as zero: the recording agrees with that, or they are not"
        " observable from it."
    )
    return _rows("gyroscope", rows) + paragraph(said, note=True)


def verification_section(c: Calibration) -> str:
    """The errors in orientations that the calibration had not seen; empty without verification."""
    verification = c.quality.get("verification")
    found = verification.get("orientations") or () if verification else ()
    rows = [
        [
            f"{side_down(one['down'])} down",
            f"{one['magnitude_mps2']:+.4f} (±\u00a0{one['magnitude_std_mps2']:.4f})",
            f"{one['direction_deg']:.3f} (±\u00a0{one['direction_std_deg']:.3f})",
        ]
        for one in found
    ]
    if not rows:
        return ""
    said = paragraph(
        "Errors of the calibration in orientations that it had not seen, each with its predicted standard uncertainty"
        " (1 sigma)."
    )
    return section(
        "Verification", said, table("verification", "", ["", "|a| error, m/s²", "direction error, deg"], rows)
    )


def matrices(c: Calibration) -> str:
    """The parameters as calibration.json has them."""
    rows = [[f"D {axis}", *map(_pair, c.D[i], c.D_std[i])] for i, axis in enumerate(AXES)]
    rows.append(["b_a, m/s²", *map(_pair, c.b_a, c.b_a_std)])
    rows.append(["noise, m/s²", *(number(value) for value in c.noise_std)])
    turned = [[f"K {axis}", *map(_pair, c.K[i], c.K_std[i])] for i, axis in enumerate(AXES)]
    turned.append(["b_omega, rad/s", *map(_pair, c.b_omega, c.b_omega_std)])
    turned.append(["noise, rad/s", *(number(value) for value in c.gyro_noise_std)])
    caption = "{}; " + CAPTION
    return table("parameters", caption.format(ACCELEROMETER_FORMULA), ["", *AXES], rows) + table(
        "gyro-parameters", caption.format(GYROSCOPE_FORMULA), ["", *AXES], turned
    )


def _rows(id_: str, rows: Sequence[ParameterRow]) -> str:
    """A table with a column for each axis."""
    cells = [[f"{row.name}, {row.unit}", *map(_unbroken, row.cells)] for row in rows]
    return table(id_, CAPTION, ["", *AXES], cells)


def _pair(value: float, std: float) -> str:
    return _unbroken(with_std(value, std, most_digits=9).removeprefix("+"))


def _unbroken(text: str) -> str:
    """No line breaks after ±: where a column is narrow, the deviation goes below its value as a whole."""
    return text.replace("± ", "±\u00a0")
