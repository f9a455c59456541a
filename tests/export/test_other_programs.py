"""Kalibr, OpenVINS, i2cdevlib, MicroPython and ESPHome: their arithmetic, restated from their sources, on numbers."""

import ast
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import WriteBackError
from mpucal.export.forms import form

RATES = np.random.default_rng(5).uniform(-4.0, 4.0, (200, 3))


def test_kalibr_multiplies_the_density_by_the_root_of_the_rate(calibration):
    found = yaml.safe_load(form("kalibr").export(calibration)[0])
    # ImuParameters of kalibr_common/ConfigReader.py: discrete = density / sqrt(1 / update_rate), each key above 0
    assert set(found) == {
        *(f"{of}_{kind}" for of in ("accelerometer", "gyroscope") for kind in ("noise_density", "random_walk")),
        "rostopic",
        "update_rate",
    }
    for of, std in (("accelerometer", calibration.noise_std), ("gyroscope", calibration.gyro_noise_std)):
        discrete = found[f"{of}_noise_density"] / math.sqrt(1 / found["update_rate"])
        assert discrete == pytest.approx(np.sqrt(np.mean(std**2)), rel=1e-12)
        assert found[f"{of}_random_walk"] > 0


def test_openvins_propagates_corrected_samples(calibration, samples):
    text, notes = form("openvins").export(calibration)
    assert text.startswith("%YAML:1.0\n")
    imu = yaml.safe_load(text.removeprefix("%YAML:1.0"))["imu0"]
    Ta, Tw, R_a, R_w, Tg = (np.array(imu[key]) for key in ("Ta", "Tw", "R_IMUtoACC", "R_IMUtoGYRO", "Tg"))
    # VioManagerOptions.h: Da = inv(Ta), of which the model "kalibr" keeps the lower triangle; State.h, Dm and R^T
    Da, Dw = np.tril(np.linalg.inv(Ta)), np.tril(np.linalg.inv(Tw))
    a = (samples - calibration.b_a) @ (R_a.T @ Da).T
    w = (RATES - calibration.b_omega - a @ Tg.T) @ (R_w.T @ Dw).T
    wanted_a, wanted_w = calibration.apply(samples, RATES)
    np.testing.assert_allclose(a, wanted_a, atol=1e-12)
    np.testing.assert_allclose(w, wanted_w, atol=1e-12)
    for R in (R_a, R_w):
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)
    assert "estimates b_a and b_omega itself" in notes[0]


MPU6050_H = """
#include <stdio.h>
struct MPU6050 {
    void setXAccelOffset(short v) { printf("%d ", v); } void setYAccelOffset(short v) { printf("%d ", v); }
    void setZAccelOffset(short v) { printf("%d\\n", v); } void setXGyroOffset(short v) { printf("%d ", v); }
    void setYGyroOffset(short v) { printf("%d ", v); } void setZGyroOffset(short v) { printf("%d\\n", v); }
};
"""


def test_the_registers_that_i2cdevlib_sets_take_the_biases_away(calibration, samples, compiled, tmp_path):
    (tmp_path / "MPU6050.h").write_text(MPU6050_H)
    (tmp_path / "offsets.h").write_text(form("i2cdevlib").export(calibration)[0])
    program = '#include "offsets.h"\nint main() { MPU6050 mpu; setOffsets(mpu); }\n'
    a_words, w_words = compiled(tmp_path, "main.cpp", program)().astype(int)
    trim = np.array(calibration.sensor.accel_offsets)
    assert ((a_words ^ trim) & 1 == 0).all()
    # of the register maps: 2048 counts to 1 g, and 4 / 131 deg/s a count, added to what is measured
    a = samples + (a_words - trim) / 2048 * G
    w = RATES + np.radians(w_words * 4 / 131)
    assert np.abs(a - (samples - calibration.b_a)).max() <= 1.001 * G / 2048
    assert np.abs(w - (RATES - calibration.b_omega)).max() <= 0.501 * np.radians(4 / 131)


@pytest.mark.parametrize("name", ["kalibr", "openvins", "i2cdevlib"])
def test_unknown_values_are_refused_rather_than_invented(calibration, name):
    unknown = replace(calibration.sensor, accel_offsets=None)
    with pytest.raises(WriteBackError, match=r"lacks the (noise|content of the accelerometer's offset registers)"):
        form(name).export(replace(calibration, sensor=unknown, gyro_noise_std=np.full(3, np.nan)))


FOLLOWING = {"b_a_slope": np.array([0.001, -0.02, 0.003]), "temperature_range_c": np.array([5.0, 40.0])}


def test_the_micropython_module_needs_nothing(calibration, samples):
    calibration = replace(calibration, **FOLLOWING)
    text, _ = form("micropython").export(calibration)
    assert not [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    module = {}
    exec(text, module)
    a, w = calibration.apply(samples, RATES)
    np.testing.assert_allclose([module["apply"](y) for y in samples.tolist()], a, atol=1e-6)
    np.testing.assert_allclose([module["apply_gyro"](y) for y in RATES.tolist()], w, atol=1e-6)
    counts = [100, -20000, 32767]
    y_a = np.array(counts) * (4 * G / 32768)
    for T in (-20.0, 12.5, 60.0, math.nan):
        np.testing.assert_allclose(module["apply_counts"](counts, 4, T), calibration.apply(y_a, None, T), atol=1e-6)
    y_w = np.array(counts) * np.radians(1 / 65.5)
    np.testing.assert_allclose(module["apply_gyro_counts"](counts, 500), calibration.apply(y_a, y_w)[1], atol=1e-6)
    with pytest.raises(ValueError, match="calibrated at a range of 4"):
        module["apply_counts"](counts, 2)


# ESPHome makes id(name) an access to the component, and the lambda a function that returns optional<float>
ESPHOME = """#include <algorithm>
#include <cmath>
#include <cstdio>
struct { float state; } %s;
%s
int main() {
    int v[7];
    for (int i = 0; scanf("%%d", &v[i]) == 1; i = (i + 1) %% 7) {
        if (i < 6) continue;
        measured_accel_x.state = (short)v[0] * 0.000061f * 9.80665f;
        measured_accel_y.state = (short)v[1] * 0.000061f * 9.80665f;
        measured_accel_z.state = (short)v[2] * 0.000061f * 9.80665f;
        measured_temperature.state = v[3] ? v[3] / 340.0f + 36.53f : NAN;
        measured_gyro_x.state = v[4] * 0.060975f;
        measured_gyro_y.state = v[5] * 0.060975f;
        measured_gyro_z.state = v[6] * 0.060975f;
        printf("%%.9g %%.9g %%.9g %%.9g %%.9g %%.9g\\n", f0(), f1(), f2(), f3(), f4(), f5());
    }
}
"""


def test_esphomes_lambdas_compiled_and_fed_with_counts(calibration, compiled, tmp_path):
    calibration = replace(calibration, **FOLLOWING)
    measured, *made = yaml.safe_load(form("esphome").export(calibration)[0])["sensor"]
    assert measured["platform"] == "mpu6050"
    assert [sensor["platform"] for sensor in made] == ["template"] * 6
    ids = [part["id"] for part in measured.values() if isinstance(part, dict)]
    bodies = [re.sub(r"id\((\w+)\)", r"\1", sensor["lambda"]) for sensor in made]
    functions = "".join(f"float f{i}() {{ {body} }}\n" for i, body in enumerate(bodies))
    run = compiled(tmp_path, "main.cpp", ESPHOME % (", ".join(ids), functions))
    counts = np.random.default_rng(7).integers(-32768, 32768, (100, 7))
    counts[::5, 3] = 0
    out = run("".join(" ".join(map(str, row)) + "\n" for row in counts))
    T = np.where(counts[:, 3] == 0, np.nan, counts[:, 3] / 340 + 36.53)
    a, w = calibration.apply(counts[:, :3] * G / 16384, counts[:, 4:] * np.radians(1 / 16.375), T)
    np.testing.assert_allclose(out[:, :3], a, atol=2e-5)
    np.testing.assert_allclose(out[:, 3:], np.degrees(w), atol=2e-3)


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("esphome", {}, r"sets \+-2000 deg/s, but the calibration is of \+-500 deg/s.*with --gyro-range 2000"),
        ("arduino", {"accel_range_g": None}, r"sets \+-4 g, but the calibration is of another"),
    ],
)
def test_an_export_says_what_it_assumes(calibration, name, changes, words):
    _, notes = form(name).export(replace(calibration, sensor=replace(calibration.sensor, **changes)))
    assert re.search(words, " ".join(notes))
