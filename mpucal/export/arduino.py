"""A calibration as an Arduino sketch that reads the chip over Wire and prints calibrated accelerations and rates."""

from __future__ import annotations

from collections.abc import Sequence

from ..chip.families import MPU6050, family_of
from ..chip.registers import ACCEL_RANGES_G, FULL_SCALE_SHIFT, GYRO_RANGES_DPS
from ..data import ACCEL_COUNTS, GYRO_COUNTS
from ..result.calibration import Calibration
from .c_code import INCLUDES, c_functions, c_temperature_function
from .losses import heading

# values of the registers by the range
ACCEL_CONFIG = {float(g): code << FULL_SCALE_SHIFT for code, g in enumerate(ACCEL_RANGES_G)}
GYRO_CONFIG = {float(dps): code << FULL_SCALE_SHIFT for code, dps in enumerate(GYRO_RANGES_DPS)}
DEFAULT_RANGE_G, DEFAULT_RANGE_DPS = 4.0, 500.0


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the sketch's text, with `notes` in its heading."""
    remarks = "\n".join(heading(calibration, notes, "// ", "m/s^2, rad/s"))
    functions = f"{c_functions(calibration)}{c_temperature_function(calibration)}"
    return f"{remarks}\n#include <Wire.h>\n{INCLUDES}\n{functions}{_constants(calibration)}{_BODY}"


def losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on assumptions of the sketch."""
    sensor, notes = calibration.sensor, ["It reads the chip at address 0x68: if AD0 is high, change CHIP to 0x69."]
    if sensor.accel_range_g not in ACCEL_CONFIG:
        notes.append(f"It sets +-{DEFAULT_RANGE_G:g} g, but the calibration is of another or unknown range.")
    if sensor.gyro_range_dps not in GYRO_CONFIG:
        notes.append(f"It sets +-{DEFAULT_RANGE_DPS:g} deg/s, but the calibration is of another or unknown range.")
    if family_of(sensor.chip) is None and calibration.follows_temperature:
        notes.append("It assumes the thermometer of an MPU-6050; `mpucal doctor` shows which chip it is.")
    return tuple(notes)


def _constants(calibration: Calibration) -> str:
    sensor = calibration.sensor
    range_g = sensor.accel_range_g if sensor.accel_range_g in ACCEL_CONFIG else DEFAULT_RANGE_G
    range_dps = sensor.gyro_range_dps if sensor.gyro_range_dps in GYRO_CONFIG else DEFAULT_RANGE_DPS
    family = family_of(sensor.chip) or MPU6050
    return f"""
static const uint8_t CHIP = 0x68;
static const uint8_t ACCEL_CONFIG = 0x{ACCEL_CONFIG[range_g]:02x}, GYRO_CONFIG = 0x{GYRO_CONFIG[range_dps]:02x};
static const float MPS2_PER_COUNT = {range_g:g} * 9.80665f / {ACCEL_COUNTS:.0f};  // +-{range_g:g} g
static const float RAD_S_PER_COUNT = {range_dps:g} * 0.01745329252f / {GYRO_COUNTS:.0f};  // +-{range_dps:g} deg/s
static const float LSB_PER_C = {family.lsb_per_c:g}, ZERO_C = {family.zero_c:g};
"""


_BODY = """
static void set(uint8_t reg, uint8_t value) {
    Wire.beginTransmission(CHIP);
    Wire.write(reg);
    Wire.write(value);
    Wire.endTransmission();
}

// Read one sample: accelerometer x, y, z, temperature, gyroscope x, y, z; false if the chip does not answer.
static bool measure(int16_t counts[7]) {
    Wire.beginTransmission(CHIP);
    Wire.write((uint8_t)0x3B);
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(CHIP, (size_t)14) != 14)
        return false;
    for (uint8_t i = 0; i < 7; i++) {
        uint8_t high = (uint8_t)Wire.read();
        counts[i] = (int16_t)((uint16_t)high << 8 | (uint8_t)Wire.read());
    }
    return true;
}

void setup() {
    Serial.begin(115200);
    Wire.begin();
    set(0x6B, 0x01);  // awake, on the gyroscope's clock
    set(0x1B, GYRO_CONFIG);
    set(0x1C, ACCEL_CONFIG);
}

void loop() {
    int16_t counts[7];
    float y_a[3], y_w[3], a[3], w[3];
    if (measure(counts)) {
        for (uint8_t i = 0; i < 3; i++) {
            y_a[i] = counts[i] * MPS2_PER_COUNT;
            y_w[i] = counts[4 + i] * RAD_S_PER_COUNT;
        }
        mpucal_correct_at(y_a, counts[3] / LSB_PER_C + ZERO_C, a);
        mpucal_correct_gyro(y_w, w);
        for (uint8_t i = 0; i < 6; i++) {
            Serial.print(i < 3 ? a[i] : w[i - 3], 4);
            Serial.print(i < 5 ? '\\t' : '\\n');
        }
    }
    delay(10);
}
"""
