"""A calibration as YAML for ESPHome: its mpu6050 sensor, and a template sensor of each calibrated axis.

ESPHome publishes counts * 0.000061 * 9.80665 m/s^2 at +-2 g (mpu6050.cpp), where 1 g is 16384 counts: its numbers are
made the nominal ones first.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..result.calibration import Calibration
from .losses import head

G_PER_COUNT, NOMINAL = 0.000061, 1 / 16384
RANGE_G = 2.0


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The `sensor:` part of a configuration, with `notes` in its head."""
    lines = [f"# {line}" for line in (f"{head(calibration)}.", *notes)]
    lines += ["sensor:", "  - platform: mpu6050", "    update_interval: 1s"]
    for axis in "xyz":
        lines += [f"    accel_{axis}:", f"      id: measured_{axis}", "      internal: true"]
    inverse, bias = calibration.inverse * (NOMINAL / G_PER_COUNT), calibration.b_a_to_subtract * (G_PER_COUNT / NOMINAL)
    for i, axis in enumerate("xyz"):
        terms = " + ".join(
            f"{inverse[i, j]:.9e}f * (id(measured_{of}).state - {bias[j]:.9e}f)" for j, of in enumerate("xyz")
        )
        lines += [
            "  - platform: template",
            f'    name: "Acceleration {axis}"',
            f"    id: acceleration_{axis}",
            '    unit_of_measurement: "m/s²"',
            "    accuracy_decimals: 4",
            "    update_interval: 1s",
            f'    lambda: "return {terms.replace("- -", "+ ")};"',
        ]
    return "\n".join(lines) + "\n"


def left(calibration: Calibration) -> tuple[str, ...]:
    """What it is for another range."""
    range_g = calibration.sensor.accel_range_g
    if range_g in (None, RANGE_G):
        return ()
    return (
        f"ESPHome sets +-2 g, and the calibration is of +-{range_g:g} g: what its scale differs between both is left.",
    )
