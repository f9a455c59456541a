"""Each form applied the way its reader does, against Calibration.apply, to the form's own rounding."""

import ast
import json
import math
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import yaml

from mpucal.chip import registers as reg
from mpucal.data import STANDARD_GRAVITY_MPS2
from mpucal.errors import MpucalError, RefusedError
from mpucal.export.forms import FORMS, form
from mpucal.result.calibration import Calibration

# error of float32 that the header states
FLOAT_MPS2 = 2e-4
APPLIED = np.array([0.25, -0.2, 1.0])
FOLLOWING = {"b_a_slope": np.array([0.001, -0.02, 0.003]), "temperature_range_c": np.array([5.0, 40.0])}
TEMPERATURES_C = np.array([-20.0, 5.0, 12.5, 27.5, 33.0, 60.0, np.nan])


def table(values):
    return "".join(" ".join(f"{v:.9g}" for v in row) + "\n" for row in values)


C = """
#include <stdio.h>
#define MPUCAL_USED_RANGE_G %d
/* a file can include both */
#include "mpucal_apply.h"
#include "calibration.h"
int main(void) {
    float v[13];
    short c[6];
    while (scanf("%%f %%f %%f %%f %%hd %%hd %%hd %%hd %%hd %%hd", v, v + 1, v + 2, v + 3,
                 c, c + 1, c + 2, c + 3, c + 4, c + 5) == 10) {
        mpucal_correct_at(v, v[3], v + 4);
        if (mpucal_correct_counts(c, MPUCAL_USED_RANGE_G / 2, v + 7)) return 1;
        if (!mpucal_correct_counts(c, MPUCAL_USED_RANGE_G, v + 7)) return 2;
        if (!mpucal_correct_gyro_counts(c + 3, 125 * MPUCAL_USED_RANGE_G, v + 10)) return 3;
        for (int i = 4; i < 13; ++i) printf("%%.9g ", (double)v[i]);
        printf("%%.9g\\n", (double)MPUCAL_D[0][1]);
    }
    return 0;
}
"""
STRICT = ("-Wextra", "-Wpedantic")


@pytest.mark.parametrize(
    ("name", "flags", "code", "applied"),
    [
        ("main.c", ("-std=c99", "-O2", "-ffast-math"), 1, APPLIED),
        ("main.cpp", ("-std=c++11",), 0, np.zeros(3)),
        ("main.c", ("-std=c99",), 3, np.zeros(3)),
    ],
    ids=["C99, 4 g, applied in hardware", "C++11, 2 g", "C99, 16 g"],
)
def test_the_c_header_compiled_and_run(calibration, samples, compiled, tmp_path, name, flags, code, applied):
    range_g, range_dps = reg.ACCEL_RANGES_G[code], reg.GYRO_RANGES_DPS[code]
    sensor = replace(calibration.sensor, accel_range_g=float(range_g), gyro_range_dps=float(range_dps))
    calibrated = replace(calibration, sensor=sensor, applied_in_hardware=applied, **FOLLOWING)
    text, notes = form("c-header").export(calibrated)
    (tmp_path / "calibration.h").write_text(text)
    T = np.resize(TEMPERATURES_C, len(samples))
    counts = np.random.default_rng(4).integers(-32768, 32768, (len(samples), 6))
    counts[:2] = [32767, -32768] * 3, [-32768, 32767] * 3
    run = compiled(tmp_path, name, C % range_g, *STRICT, "-Wconversion", "-Wshadow", *flags)
    out = run(table(np.column_stack([samples, T, counts])))
    error = np.abs(out[:, :3] - calibrated.apply(samples, temperature_c=T)).max()
    assert error < FLOAT_MPS2
    stated = next(float(re.search(r"up to (\S+) m/s", note)[1]) for note in notes if "float32" in note)
    assert error < 2 * stated < 1e-3
    # as the driver makes samples of a frame; float32 rounds eight times at full scale
    a, w = calibrated.apply(counts[:, :3] * reg.mps2_per_lsb(code), counts[:, 3:] * reg.rad_s_per_lsb(code))
    np.testing.assert_allclose(out[:, 3:6], a, atol=8 * 2**-24 * 160)
    np.testing.assert_allclose(out[:, 6:9], w, atol=8 * 2**-24 * 40)
    assert out[0, 9] == pytest.approx(calibrated.D[0, 1], rel=1e-6)
    words = ["gcc", "-fsyntax-only", "-DMPUCAL_USED_RANGE_G=8", "calibration.h"]
    refused = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert f"this calibration is of +-{range_g} g, but MPUCAL_USED_RANGE_G is another range" in refused.stderr


@pytest.mark.parametrize("code", range(4))
def test_the_factors_for_the_rates_of_libraries(calibration, code):
    """Divide the counts as the libraries do, whose sources were compiled; see losses.scale_of_rates."""
    dps = reg.GYRO_RANGES_DPS[code]
    calibration = replace(calibration, sensor=replace(calibration.sensor, gyro_range_dps=float(dps)))
    (note,) = [note for note in form("c-header").export(calibration)[1] if note.startswith("Rates")]
    counts = np.array([30000, -20000, 100])
    _, w = calibration.apply(np.zeros(3), counts * reg.rad_s_per_lsb(code))
    rounded = {"Adafruit_MPU6050 and MPU6050_light": (131, 65.5, 32.8, 16.4)[code], "FastIMU": 32768 / dps}
    for library, lsb_per_dps in rounded.items():
        factor = re.search(rf"{library} by ([\d.]+)", note)
        assert factor or lsb_per_dps == reg.GYRO_LSB_PER_DPS[code]
        rates = np.radians(counts / lsb_per_dps) * (float(factor[1]) if factor else 1.0)
        np.testing.assert_allclose(calibration.apply(np.zeros(3), rates)[1], w, rtol=2e-6, atol=1e-6)


# the part of Arduino that a sketch uses: a chip at 0x68 with counts from stdin, and a serial port on stdout
ARDUINO = """
#pragma once
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
static int16_t given[7];
static uint8_t registers[128], at, sent[2], length, taken;
struct Port {
    void begin(long) {}
    void print(float value, int digits) { printf("%.*f", digits, (double)value); }
    void print(char c) { putchar(c); }
};
static Port Serial;
static void delay(int) {}
"""
WIRE = """
#pragma once
#include "Arduino.h"
struct Bus {
    void begin() {}
    void beginTransmission(uint8_t address) { if (address != 0x68) abort(); length = 0; }
    void write(uint8_t value) { sent[length++] = value; }
    int endTransmission(bool = true) { at = sent[0]; if (length == 2) registers[at] = sent[1]; return 0; }
    int requestFrom(uint8_t, uint8_t count) { taken = 0; return count; }
    int read() {
        if (at != 0x3B || registers[0x6B] != 0x01 || registers[0x1C] != RANGE_BITS || registers[0x1B] != RANGE_BITS)
            abort();
        uint16_t value = (uint16_t)given[taken / 2];
        return taken++ % 2 ? value & 0xFF : value >> 8;
    }
};
static Bus Wire;
"""
HOST = """
#include "Arduino.h"
#include "sketch.ino"
int main() {
    setup();
    for (int i = 0; scanf("%hd", &given[i]) == 1; i = (i + 1) % 7) if (i == 6) loop();
}
"""


@pytest.mark.parametrize(
    ("range_g", "bits", "applied"), [(4.0, 0x08, APPLIED), (16.0, 0x18, np.zeros(3))], ids=["4 g", "16 g"]
)
def test_the_sketch_compiled_and_run_on_a_stand_in_for_arduino(calibration, compiled, tmp_path, range_g, bits, applied):
    sensor = replace(calibration.sensor, accel_range_g=range_g, gyro_range_dps=125 * range_g)
    calibrated = replace(calibration, sensor=sensor, applied_in_hardware=applied, **FOLLOWING)
    (tmp_path / "sketch.ino").write_text(form("arduino").export(calibrated)[0])
    (tmp_path / "Arduino.h").write_text(ARDUINO)
    (tmp_path / "Wire.h").write_text(WIRE)
    counts = np.random.default_rng(1).integers(-32768, 32768, (100, 7))
    run = compiled(tmp_path, "host.cpp", HOST, *STRICT, "-std=c++11", f"-DRANGE_BITS={bits}")
    out = run("".join(" ".join(map(str, row)) + "\n" for row in counts))
    y = counts[:, :3] * range_g * STANDARD_GRAVITY_MPS2 / 32768
    a, w = calibrated.apply(y, counts[:, 4:] * np.radians(range_g / 2 / 131), counts[:, 3] / 340 + 36.53)
    # the sketch prints four decimals
    assert np.abs(out[:, :3] - a).max() < 6e-5 + range_g * 1e-5
    np.testing.assert_allclose(out[:, 3:], w, atol=6e-5)


def test_the_python_module_needs_numpy_alone(calibrated, samples):
    text, _ = form("python").export(calibrated)
    imported = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [name.name for node in imported for name in node.names] == ["numpy"]
    module = {}
    exec(text, module)
    a, w = calibrated.apply(samples, samples)
    np.testing.assert_allclose(module["apply"](samples), a, atol=1e-6)
    np.testing.assert_allclose(module["apply_gyro"](samples), w, atol=1e-6)
    following, T = replace(calibrated, **FOLLOWING), np.resize(TEMPERATURES_C, len(samples))
    exec(form("python").export(following)[0], module)
    a = following.apply(samples, temperature_c=T)
    np.testing.assert_allclose(module["apply"](samples, T), a, atol=1e-6)
    np.testing.assert_allclose(module["apply"](samples[0], T[0]), a[0], atol=1e-6)


def test_the_yaml_as_imu_calib_applies_it(calibrated, samples):
    found = yaml.safe_load(form("ros").export(calibrated)[0])
    SM, bias = np.reshape(found["SM"], (3, 3)), np.array(found["bias"])
    np.testing.assert_allclose(samples @ SM.T - bias, calibrated.apply(samples), atol=1e-9)
    covariance = np.reshape(found["linear_acceleration_covariance"], (3, 3))
    np.testing.assert_array_equal(covariance, np.diag(calibrated.noise_std**2))


def test_the_ros_file_describes_the_gyroscope(calibration):
    """Expect no remaining bias, since imu_calib subtracts the mean of the first samples, and no covariance of zeros.

    Zeros would tell ROS that it is unknown.
    """
    quiet = replace(calibration, gyro_noise_std=np.array([4.1e-5, 5e-7, 1.2e-3]))
    text, notes = form("ros").export(quiet)
    found = yaml.safe_load(text)["angular_velocity_covariance"]
    np.testing.assert_array_equal(np.reshape(found, (3, 3)), np.diag(quiet.gyro_noise_std**2))
    assert "deg/s remain" not in text
    assert "up to 2.00 % of a rate remain" in notes[0]


def device(folder, *writable, words=(-1501, 2000, 701)):
    """An IIO device's folder; its mount matrix is one for all channels."""
    folder.mkdir(exist_ok=True)
    for axis, word in zip("xyz", words, strict=True):
        (folder / f"in_accel_{axis}_calibbias").write_text(f"{word}")
        if "calibscale" in writable:
            (folder / f"in_accel_{axis}_calibscale").write_text("1")
    (folder / "in_mount_matrix").write_text("1, 0, 0; 0, 1, 0; 0, 0, 1")
    return folder


def seen_by_iio(folder, said, y, trim):
    """M diag(calibscale) (y + what the registers add), as iio-sensor-proxy has it; 2048 counts to 1 g.

    inv_mpu6050 prints 0.001196 m/s^2 for a count at 4 g.
    """
    words = [int((folder / f"in_accel_{axis}_calibbias").read_text()) for axis in "xyz"]
    assert [word & 1 for word in words] == [word & 1 for word in trim]
    added = (np.array(words) - trim) / 2048 * STANDARD_GRAVITY_MPS2
    scales = [folder / f"in_accel_{axis}_calibscale" for axis in "xyz"]
    scale = np.array([float(path.read_text()) if path.exists() else 1.0 for path in scales])
    assert (folder / "in_mount_matrix").read_text() == "1, 0, 0; 0, 1, 0; 0, 0, 1"
    text = re.search(r"ACCEL_MOUNT_MATRIX=(.*)", said)[1]
    M = np.array([[float(word) for word in row.split(",")] for row in text.split(";")])
    return ((y + added) * (0.001196 / (STANDARD_GRAVITY_MPS2 / 8192)) * scale) @ M.T


@pytest.mark.parametrize("writable", [(), ("calibscale",)], ids=["inv_mpu6050", "scale"])
def test_the_sysfs_commands_as_iio_means_them(calibrated, samples, tmp_path, writable):
    text, notes = form("linux-iio").export(calibrated)
    (tmp_path / "calibrate.sh").write_text(text)
    folder, trim = device(tmp_path / "iio", *writable), np.array(calibrated.sensor.accel_offsets)
    words = ["sh", str(tmp_path / "calibrate.sh"), str(folder)]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    left = float(re.search(r"up to (\S+) m/s\^2 of b_a", " ".join(notes))[1])
    # the new words include the subtraction of the old ones, so the whole of b_a is subtracted
    wanted = replace(calibrated, applied_in_hardware=np.zeros(3)).apply(samples)
    a = seen_by_iio(folder, said, samples, trim)
    assert np.abs(a - wanted).max() < 1.1 * np.sqrt(3) * left
    # the device has one matrix, which the gyroscope would share
    assert "mount-matrix =" not in said
    # a second run changes nothing
    before = {path.name: path.read_text() for path in folder.iterdir()}
    subprocess.run(words, capture_output=True, check=True)
    assert {path.name: path.read_text() for path in folder.iterdir()} == before
    assert subprocess.run([*words[:-1], tmp_path / "nowhere"], capture_output=True, check=False).returncode != 0


def test_no_register_is_written_that_the_driver_misplaces(calibration):
    of_6500 = replace(calibration, sensor=replace(calibration.sensor, chip="MPU-6500", who_am_i=0x70))
    text, notes = form("linux-iio").export(of_6500)
    assert 'calibbias"' not in text
    assert "subtract b_a, (+0.3100, -0.2200, +1.0800) m/s^2" in notes[0]


def test_json_and_blob_make_each_other(calibrated, tmp_path):
    calibrated = replace(calibrated, **FOLLOWING)
    calibrated.save(tmp_path / "one.bin")
    (tmp_path / "two.json").write_text(form("json").export(Calibration.load(tmp_path / "one.bin"))[0])
    Calibration.load(tmp_path / "two.json").save(tmp_path / "three.bin")
    assert (tmp_path / "three.bin").read_bytes() == (tmp_path / "one.bin").read_bytes()
    document = json.loads((tmp_path / "two.json").read_text())
    np.testing.assert_allclose(document["accelerometer"]["D"], calibrated.D, rtol=1e-7)


@pytest.mark.parametrize("name", [row.name for row in FORMS if row.only_usable])
def test_unusable_calibrations_are_not_exported(calibration, name):
    for changes in ({"quality": {"verdict": "refused"}}, {"b_a": np.full(3, math.nan)}, {"D": np.ones((3, 3))}):
        with pytest.raises(RefusedError, match="nothing was exported"):
            form(name).export(replace(calibration, **changes))


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
def test_a_chips_calibration_is_not_exported_to_an_autopilot(calibration, name):
    with pytest.raises(MpucalError, match="of no vehicle"):
        form(name).export(calibration)


@pytest.mark.parametrize("name", ["c-header", "linux-iio", "arduino"])
def test_notes_state_the_errors_that_temperature_and_registers_leave(calibration, name):
    text, notes = form(name).export(replace(calibration, applied_in_hardware=APPLIED, **FOLLOWING))
    said = " ".join(notes)
    # these two correct the temperature themselves
    assert name in ("arduino", "esphome") or "the error is up to 0.02 m/s^2 per degree away from that" in said
    assert name == "linux-iio" or "after a reset" in said
    assert all(note in text.replace("\n * ", " ") for note in notes)
