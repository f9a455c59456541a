"""The recipes of docs/boards.md: each compiled or run against the calls of the library it is for, restated here."""

import re
import struct
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.export.forms import form

PAGE = (Path(__file__).parents[2] / "docs" / "boards.md").read_text(encoding="utf-8")
RECIPES = {
    name: body for name, body in re.findall(r"```c(?:pp)?\n(?://|/\*) (.*?)(?: \*/)?\n(.*?)```", PAGE, re.DOTALL)
}
COUNTS = (1000, -2000, 8000, 300, -200, 30000)
# what a library's calls are, with COUNTS behind; its range [g, deg/s]; and whether the recipe corrects rates
LIBRARIES = {
    "i2cdevlib": (
        """#include <stdint.h>
        struct { void getMotion6(int16_t *ax, int16_t *ay, int16_t *az, int16_t *gx, int16_t *gy, int16_t *gz) {
            *ax = COUNTS[0]; *ay = COUNTS[1]; *az = COUNTS[2]; *gx = COUNTS[3]; *gy = COUNTS[4]; *gz = COUNTS[5]; }
        } mpu;""",
        (2.0, 250.0),
        True,
    ),
    "Adafruit_MPU6050": (
        """typedef struct { union { float v[3]; struct { float x, y, z; }; }; } sensors_vec_t;
        typedef struct { union { float data[4]; sensors_vec_t acceleration; sensors_vec_t gyro; float temperature; };
        } sensors_event_t;
        struct { bool getEvent(sensors_event_t *a, sensors_event_t *g, sensors_event_t *t) {
            for (int i = 0; i < 3; i++) { a->acceleration.v[i] = COUNTS[i] / 16384.0f * 9.80665f;
                g->gyro.v[i] = COUNTS[3 + i] / 65.5f * 0.017453293f; }
            t->temperature = 30.0f; return true; }
        } mpu;""",
        (2.0, 500.0),
        True,
    ),
    "FastIMU": (
        """struct AccelData { float accelX, accelY, accelZ; };
        struct { void update() {} void getAccel(AccelData *out) {
            out->accelX = COUNTS[0] / 2048.0f; out->accelY = COUNTS[1] / 2048.0f; out->accelZ = COUNTS[2] / 2048.0f; }
        } IMU;""",
        (16.0, 2000.0),
        False,
    ),
    "Zephyr": (
        """#include <stdint.h>
        struct sensor_value { int32_t val1, val2; };
        enum sensor_channel { SENSOR_CHAN_ACCEL_XYZ = 3 };
        struct device; static const struct device *dev;
        int sensor_sample_fetch(const struct device *) { return 0; }
        int sensor_channel_get(const struct device *, enum sensor_channel, struct sensor_value *v) {
            for (int i = 0; i < 3; i++) { double y = COUNTS[i] * 9.80665 / 16384; v[i].val1 = (int32_t)y;
                v[i].val2 = (int32_t)((y - v[i].val1) * 1e6); }
            return 0; }
        float sensor_value_to_float(const struct sensor_value *v) { return v->val1 + v->val2 / 1e6f; }""",
        (2.0, 250.0),
        False,
    ),
}


def test_each_library_has_a_recipe():
    assert RECIPES.keys() == LIBRARIES.keys()


@pytest.mark.parametrize("name", LIBRARIES)
def test_a_recipe_compiles_and_corrects(name, calibration, compiled, tmp_path):
    interface, (range_g, range_dps), has_rates = LIBRARIES[name]
    sensor = replace(calibration.sensor, accel_range_g=range_g, gyro_range_dps=range_dps)
    calibration = replace(calibration, sensor=sensor)
    (tmp_path / "calibration.h").write_text(form("c-header").export(calibration)[0])
    rates = 'std::printf("%.9g %.9g %.9g ", w[0], w[1], w[2]);' if has_rates else ""
    program = (
        f"#include <cstdio>\nstatic const short COUNTS[] = {{{', '.join(map(str, COUNTS))}}};\n"
        'struct { void println(const char *) { std::puts("refused"); } } Serial;\n'
        f'{interface}\n#include "calibration.h"\nint main() {{\n(void)Serial;\n{RECIPES[name]}\n'
        f'{rates} std::printf("%.9g %.9g %.9g\\n", a[0], a[1], a[2]); }}\n'
    )
    (found,) = compiled(tmp_path, "main.cpp", program, "-std=c++17")()
    y, y_w = np.array(COUNTS[:3]) * range_g * G / 32768, np.array(COUNTS[3:]) * np.radians(range_dps / 32750)
    a, w = calibration.apply(y, y_w)
    wanted = np.concatenate([w, a]) if has_rates else a
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_micropythons_recipe_runs(calibration, monkeypatch):
    module = ModuleType("calibration")
    exec(form("micropython").export(calibration)[0], vars(module))
    monkeypatch.setitem(sys.modules, "calibration", module)
    words = (*COUNTS[:3], -700, *COUNTS[3:])
    # asleep after power-up
    registers = bytearray(128)
    registers[reg.PWR_MGMT_1] = 0x40

    def write(address, register, data):
        assert address == 0x68
        registers[register : register + len(data)] = data

    def read(*where):
        assert where == (0x68, 0x3B, 14)
        assert not registers[reg.PWR_MGMT_1] & 0x40
        return struct.pack(">7h", *words)

    names = {"i2c": SimpleNamespace(readfrom_mem=read, writeto_mem=write)}
    exec(re.search(r"```python\n# MicroPython\n(.*?)```", PAGE, re.DOTALL)[1], names)
    range_g, range_dps = 2 << (registers[reg.ACCEL_CONFIG] >> 3 & 3), 250 << (registers[reg.GYRO_CONFIG] >> 3 & 3)
    y, y_w = np.array(COUNTS[:3]) * range_g * G / 32768, np.array(COUNTS[3:]) * np.radians(range_dps / 32750)
    a, w = calibration.apply(y, y_w)
    np.testing.assert_allclose(names["a"], a, atol=1e-5)
    np.testing.assert_allclose(names["w"], w, atol=1e-5)
