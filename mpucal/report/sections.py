"""The sections of the report: what to do, the parameters of both sensors, verification, and the vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..chip.families import family_of
from ..data import AXES
from ..origin import Origin
from ..result.calibration import REFUSED, USABLE, Calibration
from ..result.error_model import with_std
from ..result.keys import ACCELEROMETER_FORMULA, GYROSCOPE_FORMULA
from ..result.orientation import side_down
from .data_sheet import CAPTION, about, accelerometer_table, unusual_parameters
from .elements import as_float, code, escape, heading, number, pair, paragraph, quantity, section, table
from .units import gyroscope, unbroken

# docs/method.md, "Precision and repeatability"
REPEATABILITY = (
    "The uncertainties are those of this measurement. Such a sensor repeats its biases less precisely: to about 2 mg"
    " from one session to the next, and 2 to 10 mg while it warms up. mpucal check tells whether they have moved."
)
NO_FORMULA = "D cannot be inverted: no correction is possible."
UNOBSERVABLE = " ± ?: not observable from this recording."
TO_SINKS = (
    ("a bridge's memory", "mpucal write calibration.json bridge --serial PORT"),
    ("the chip's offset registers (only the bias)", "mpucal write calibration.json chip --bus /dev/i2c-1"),
    ("other programs", "mpucal export calibration.json --to FORMAT"),
)
# How long a calibration stays valid, besides the temperature, and what tells
OF_CHIP = (
    "As long as the chip is not disturbed: soldering, a bent board, a shock or remounting may change it.",
    "When in doubt: <code>mpucal check calibration.json --bus /dev/i2c-1</code>.",
)
OF_VEHICLE = (
    "As long as the autopilot stays on its mount: a crash, or its removal, may change it.",
    "When in doubt: <code>mpucal check calibration.json --mavlink URL</code>, or after a write with"
    " calibration-on-autopilot.json.",
)
TO_AUTOPILOT = (("the autopilot's parameters", "mpucal write calibration.json autopilot --mavlink URL"),)
RESERVED = "Consider the reservations above; to remove them, follow their remedies and repeat the session."
IN_PYTHON = ("Python", 'a = mpucal.Calibration.load("calibration.json").apply(y)')
IN_FIRMWARE = ("firmware", "mpucal export calibration.json --to c-header")


def next_step(c: Calibration) -> str:
    """Return what most people do next, with its commands."""
    if c.verdict == REFUSED:
        return '<p id="next">Next: follow the remedies, and repeat the session: <code>mpucal session</code>.</p>\n'
    places = TO_AUTOPILOT if c.extra.get("autopilot") else (IN_PYTHON, IN_FIRMWARE)
    steps = "; ".join(f"for {escape(where)}: <code>{escape(how)}</code>" for where, how in places)
    return f'<p id="next">{f"{RESERVED} " if c.verdict == USABLE else ""}Next, {steps}.</p>\n'


def other_uses(c: Calibration) -> str:
    """Return the sections on further destinations, and on how long the calibration stays valid; empty if refused."""
    if c.verdict == REFUSED:
        return ""
    uses = [f"For {escape(where)}: <code>{escape(how)}</code>" for where, how in TO_SINKS]
    other = "" if c.extra.get("autopilot") else section("Other uses", _list(uses))
    return pair(other, section("How long it stays valid", _list(_validity(c))))


def _validity(c: Calibration) -> list[str]:
    sheet, warm = family_of(c.sensor.chip), quantity(c.sensor.temperature_c, "°C", digits=3)
    drift = "" if sheet is None else f" ({escape(sheet.zero_g_drift)} by the data sheet)"
    at = f", {escape(warm)}" if warm else ""
    near = f"Near the temperature of the session{at}: the bias changes with temperature{drift}."
    within = "Within the range of measured temperatures." if c.follows_temperature else near
    return [within, *(OF_VEHICLE if c.sensor.origin is Origin.VEHICLE else OF_CHIP)]


def _list(items: list[str]) -> str:
    return "<ul>\n" + "".join(f"<li>{item}</li>\n" for item in items) + "</ul>\n"


def accelerometer_section(c: Calibration) -> str:
    """Return the section on the errors of the accelerometer, with their uncertainties, and their repeatability."""
    lasting = paragraph(REPEATABILITY, "repeatability", note=True) if c.is_regular else ""
    return section(
        "The accelerometer", unusual_parameters(c), accelerometer_table(c, "accelerometer"), about(c), lasting
    )


def formula(c: Calibration) -> str:
    """Return the correction formula."""
    if not c.is_regular:
        return paragraph(NO_FORMULA, "formula", note=True)
    intro = paragraph(f"{ACCELEROMETER_FORMULA}, in m/s², with y the output of the sensor at its nominal scale factor:")
    applied = ""
    if np.any(c.applied_in_hardware):
        applied = paragraph(
            "The chip's offset registers subtract a part of b_a already; the formula subtracts the rest.",
            note=True,
        )
    return intro + code(_formula(c), "formula") + applied


def _formula(c: Calibration) -> str:
    """Return a = inv(D) (y - b_a), one line per axis."""
    inv_D, bias = c.inverse, c.b_a_to_subtract
    rows = (
        " ".join(
            f"{factor:+.6f} * (y_{of} {-offset:+.6f})" for factor, of, offset in zip(row, "xyz", bias, strict=True)
        )
        for row in inv_D
    )
    return "\n".join(f"a_{axis} = {row}" for axis, row in zip("xyz", rows, strict=True))


def gyroscope_table(c: Calibration) -> str:
    """Return the table of the gyroscope's errors, as far as they were estimated."""
    estimated = np.isfinite(c.K_std).any()
    rows = gyroscope(c)
    if not estimated:
        rows = [row for row in rows if row.name == "bias"]
    remark = (
        f"Estimated together with the accelerometer.{'' if np.isfinite(c.K_std).all() else UNOBSERVABLE}"
        if estimated
        else "Scale factor errors and misalignments were set to zero: the recording agrees with that, or they are not"
        " observable from it."
    )
    cells = [[f"{row.name}, {row.unit}", *map(unbroken, row.cells)] for row in rows]
    return table("gyroscope", CAPTION, ["", *AXES], cells) + paragraph(remark, note=True)


def verification_section(c: Calibration) -> str:
    """Return the section on errors in orientations that the fit did not use; empty without verification."""
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
    intro = paragraph(
        "Errors of the calibration in orientations that the fit did not use, with predicted standard uncertainties"
        " (1 sigma)."
    )
    return section(
        "Verification", intro, table("verification", "", ["", "|a| error, m/s²", "direction error, deg"], rows)
    )


def matrices(c: Calibration) -> str:
    """Return the tables of the parameters as in calibration.json."""
    rows = [[f"D {axis}", *map(_pair, c.D[i], c.D_std[i])] for i, axis in enumerate(AXES)]
    rows.append(["b_a, m/s²", *map(_pair, c.b_a, c.b_a_std)])
    rows.append(["noise, m/s²", *(number(value) for value in c.noise_std)])
    gyro = [[f"K {axis}", *map(_pair, c.K[i], c.K_std[i])] for i, axis in enumerate(AXES)]
    gyro.append(["b_omega, rad/s", *map(_pair, c.b_omega, c.b_omega_std)])
    gyro.append(["noise, rad/s", *(number(value) for value in c.gyro_noise_std)])
    caption = "{}; " + CAPTION
    return table("parameters", caption.format(ACCELEROMETER_FORMULA), ["", *AXES], rows) + table(
        "gyro-parameters", caption.format(GYROSCOPE_FORMULA), ["", *AXES], gyro
    )


def _pair(value: float, std: float) -> str:
    return unbroken(with_std(value, std, most_digits=9).removeprefix("+"))


def vehicle_section(c: Calibration) -> str:
    """Return the section on a vehicle's parameters and its other IMUs; empty for a single sensor."""
    parts = _parameters("parameters-1", c.extra.get("autopilot") or {})
    for imu, document in enumerate(c.extra.get("others") or (), start=2):
        other = Calibration.from_document(document)
        parts += [
            heading(f"{other.sensor.chip or f'IMU {imu}'}: {other.verdict}"),
            accelerometer_table(other, f"accelerometer-{imu}"),
            *(paragraph(str(reason["message"]) + ".") for reason in other.quality.get("reasons", ())),
            *_parameters(f"parameters-{imu}", other.extra.get("autopilot") or {}),
        ]
    return section("The vehicle", *parts)


def _parameters(id_: str, autopilot: Mapping[str, Any]) -> list[str]:
    """Return a table of the parameters that the calibration changes, with a remark."""
    old, new = autopilot.get("params_old") or {}, autopilot.get("params_new") or {}
    if not new:
        return []
    rows = [
        [name, *(quantity(each, "") or "unknown" for each in (old.get(name), value))] for name, value in new.items()
    ]
    residual = as_float(autopilot.get("residual_mps2"))
    error = (
        f" The terms that it lacks leave errors of up to {residual:.2g} m/s² in |a|." if math.isfinite(residual) else ""
    )
    remark = paragraph(
        f"An autopilot has only offsets and scale factors, and applies them itself.{error} "
        "Set them with mpucal write calibration.json autopilot.",
        note=True,
    )
    return [table(id_, f"parameters of {autopilot.get('firmware', 'the autopilot')}", ["", "old", "new"], rows), remark]
