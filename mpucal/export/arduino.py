"""A calibration as an Arduino sketch that reads the chip over Wire and prints calibrated accelerations."""

from __future__ import annotations

from collections.abc import Sequence

from ..result.calibration import Calibration
from .code import in_c
from .losses import head

ACCEL_CONFIG = {2.0: 0x00, 4.0: 0x08, 8.0: 0x10, 16.0: 0x18}
DEFAULT_RANGE_G = 4.0


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The sketch's text, with `notes` in its head."""
    range_g = calibration.sensor.accel_range_g
    if range_g not in ACCEL_CONFIG:
        range_g = DEFAULT_RANGE_G
    remarks = "\n".join(f"// {line}" for line in (f"{head(calibration)}.", *notes))
    return f"{remarks}\n{_SKETCH_HEAD}{in_c(calibration)}{_body(range_g)}"


_SKETCH_HEAD = """
#include <Wire.h>

"""


def _body(range_g: float) -> str:
    return f"""
static const uint8_t CHIP = 0x68;
static const float MPS2_PER_COUNT = {range_g:g} * 9.80665f / 32768;

static void set(uint8_t reg, uint8_t value) {{
    Wire.beginTransmission(CHIP);
    Wire.write(reg);
    Wire.write(value);
    Wire.endTransmission();
}}

// One sample as measured, m/s^2; false where the chip does not answer.
static bool measure(float y[3]) {{
    Wire.beginTransmission(CHIP);
    Wire.write((uint8_t)0x3B);
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(CHIP, (uint8_t)6) != 6)
        return false;
    for (uint8_t i = 0; i < 3; i++) {{
        uint8_t high = Wire.read();
        uint8_t low = Wire.read();
        y[i] = (int16_t)((uint16_t)high << 8 | low) * MPS2_PER_COUNT;
    }}
    return true;
}}

void setup() {{
    Serial.begin(115200);
    Wire.begin();
    set(0x6B, 0x01);  // awake, on the gyroscope's clock
    set(0x1C, 0x{ACCEL_CONFIG[range_g]:02x});  // +-{range_g:g} g
}}

void loop() {{
    float y[3], a[3];
    if (measure(y)) {{
        mpucal_correct(y, a);
        for (uint8_t i = 0; i < 3; i++) {{
            Serial.print(a[i], 4);
            Serial.print(i < 2 ? '\\t' : '\\n');
        }}
    }}
    delay(10);
}}
"""
