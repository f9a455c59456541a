"""A calibration as YAML for ESPHome: its mpu6050 sensor, and a template sensor for each calibrated axis.

ESPHome sets +-2 g and +-2000 deg/s, and publishes counts * 0.000061 * 9.80665 m/s^2 and counts * 0.060975 deg/s
(mpu6050.cpp), but one count is 1/16384 g and 2000/32750 deg/s: its numbers are scaled to nominal ones first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range

RANGE_G, RANGE_DPS = 2.0, 2000.0
G_PER_COUNT, DPS_PER_COUNT = 0.000061, 0.060975


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the `sensor:` part of a configuration, with `notes` in its heading."""
    lines = [*heading(calibration, notes, "# "), "sensor:", "  - platform: mpu6050", "    update_interval: 1s"]
    for name in (*(f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"), "temperature"):
        lines += [f"    {name}:", f"      id: measured_{name}", "      internal: true"]
    g, dps = RANGE_G / ACCEL_COUNTS / G_PER_COUNT, RANGE_DPS / GYRO_COUNTS / DPS_PER_COUNT
    b_a, b_omega = calibration.b_a_to_subtract / g, np.degrees(np.nan_to_num(calibration.b_omega)) / dps
    follows = _away(calibration), calibration.b_a_slope / g
    lines += _axes("Acceleration", "m/s²", "accel", calibration.inverse * g, b_a, *follows)
    lines += _axes("Rate", "°/s", "gyro", calibration.K * dps, b_omega)
    return "\n".join(lines) + "\n"


def losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on a calibration of other ranges than ESPHome's."""
    notes = [
        f"ESPHome sets +-{set_to:g} {unit}, but the calibration is of +-{of:g} {unit}: the difference of scale between"
        f" the two remains; calibrate with {option} {set_to:g}."
        for of, set_to, unit, option in (
            (calibration.sensor.accel_range_g, RANGE_G, "g", "--accel-range"),
            (calibration.sensor.gyro_range_dps, RANGE_DPS, "deg/s", "--gyro-range"),
        )
        if of not in (None, set_to)
    ]
    return tuple(notes)


def _axes(
    name: str, unit: str, kind: str, gain: Vector, bias: Vector, away: str = "", slope: Vector | None = None
) -> list[str]:
    """Return a template sensor for each axis: gain (state - bias - slope away)."""
    lines: list[str] = []
    for i, axis in enumerate("xyz"):
        terms = [f"{gain[i, j]:.9e}f * (id(measured_{kind}_{of}).state - {bias[j]:.9e}f)" for j, of in enumerate("xyz")]
        terms += [f"{-(gain @ slope)[i]:.9e}f * {away}"] if away and slope is not None else []
        lines += [
            "  - platform: template",
            f'    name: "{name} {axis}"',
            f"    id: {name.lower()}_{axis}",
            f'    unit_of_measurement: "{unit}"',
            "    accuracy_decimals: 4",
            "    update_interval: 1s",
            f'    lambda: "return {" + ".join(terms).replace("- -", "+ ")};"',
        ]
    return lines


def _away(calibration: Calibration) -> str:
    """Return the temperature minus that of b_a as C++, 0 if it is not known; empty without b_a(T)."""
    if not calibration.follows_temperature:
        return ""
    at, start, end = temperature_range(calibration)
    T = "id(measured_temperature).state"
    return f"(std::isnan({T}) ? 0.0f : std::min(std::max({T}, {start:.6e}f), {end:.6e}f) - {at:.6e}f)"
