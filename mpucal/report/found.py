"""What the page says of the numbers: both sensors in people's units, the formula, the matrices. Judges nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result.calibration import ACCELEROMETER_FORMULA, GYROSCOPE_FORMULA, Calibration
from ..result.orientation import side_down
from .elements import code, number, paragraph, section, table
from .units import Measured, accelerometer, gyroscope, with_std
from .use import formula

_AXES = "xyz"
NO_FORMULA = "D cannot be inverted: these numbers correct nothing."


def is_regular(c: Calibration) -> bool:
    """Whether D and b_a are known, and D can be inverted."""
    known = np.isfinite(c.D).all() and np.isfinite(c.b_a).all()
    return bool(known and np.linalg.matrix_rank(c.D) == 3)


def accelerometer_section(c: Calibration) -> str:
    """What is wrong with the accelerometer, and how sure that is."""
    explained = paragraph(
        "An axis that leans to another one feels a part of that one's acceleration; 1 mg is 0.0098 m/s².", note=True
    )
    return section("The accelerometer", accelerometer_table(c, "accelerometer"), explained)


def accelerometer_table(c: Calibration, id_: str) -> str:
    """Its gains, biases and leans."""
    return _in_peoples_units(id_, accelerometer(c))


def formula_section(c: Calibration) -> str:
    """What mends it."""
    if not is_regular(c):
        return section("The formula", paragraph(NO_FORMULA, "formula", note=True))
    said = paragraph(f"{ACCELEROMETER_FORMULA}, in m/s², y being what the sensor delivers at its nominal scale:")
    applied = ""
    if np.any(c.applied_in_hardware):
        applied = paragraph(
            "The chip's offset registers subtract a part of b_a already; the formula holds what is left to subtract.",
            note=True,
        )
    return section("The formula", said, code(formula(c), "formula"), applied)


def gyroscope_table(c: Calibration) -> str:
    """What is wrong with the gyroscope, as far as it was estimated."""
    estimated = np.isfinite(c.K_std).any()
    rows = gyroscope(c)
    if not estimated:
        rows = [row for row in rows if row.name == "bias"]
    said = (
        "Estimated together with the accelerometer; what is ± ? the recording does not tell."
        if estimated
        else "Its gains and axes were taken as they are; the recording did not ask for more, or does not tell."
    )
    return _in_peoples_units("gyroscope", rows) + paragraph(said, note=True)


def verification_section(c: Calibration) -> str:
    """What orientations say that the calibration had not seen; empty where nobody asked them."""
    found = (c.quality.get("verification") or {}).get("orientations") or ()
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
        "Orientations that the calibration had not seen when it was put to the test: how far it was off, and what its "
        "own uncertainties promise (one standard deviation)."
    )
    return section("Verification", said, table("verification", "", ["", "|a| − gravity, m/s²", "direction, deg"], rows))


def matrices_section(c: Calibration) -> str:
    """The numbers of calibration.json themselves."""
    rows = [[f"D {axis}", *map(_pair, c.D[i], c.D_std[i])] for i, axis in enumerate(_AXES)]
    rows.append(["b_a, m/s²", *map(_pair, c.b_a, c.b_a_std)])
    rows.append(["noise, m/s²", *(number(value) for value in c.noise_std)])
    turned = [[f"K {axis}", *map(_pair, c.K[i], c.K_std[i])] for i, axis in enumerate(_AXES)]
    turned.append(["b_omega, rad/s", *map(_pair, c.b_omega, c.b_omega_std)])
    turned.append(["noise, rad/s", *(number(value) for value in c.gyro_noise_std)])
    caption = "{}; value ± standard deviation"
    return section(
        "The numbers themselves",
        table("parameters", caption.format(ACCELEROMETER_FORMULA), ["", *_AXES], rows),
        table("gyro-parameters", caption.format(GYROSCOPE_FORMULA), ["", *_AXES], turned),
    )


def _in_peoples_units(id_: str, rows: Sequence[Measured]) -> str:
    """One row a quantity, value ± standard deviation of each axis."""
    cells = [
        [f"{row.name}, {row.unit}", *("" if _is_itself(row, i) else _cell(row, i) for i in range(3))] for row in rows
    ]
    return table(id_, "value ± standard deviation", ["", *_AXES], cells)


def _is_itself(row: Measured, i: int) -> bool:
    return row.name == f"lean to {_AXES[i]}"


def _cell(row: Measured, i: int) -> str:
    return _unbroken(with_std(float(row.value[i]), float(row.std[i])))


def _pair(value: float, std: float) -> str:
    return _unbroken(with_std(value, std, most_digits=9).removeprefix("+"))


def _unbroken(text: str) -> str:
    """No line breaks after ±: where a column is narrow, the deviation goes below its value as a whole."""
    return text.replace("± ", "±\u00a0")
