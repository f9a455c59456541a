"""Kalibr, OpenVINS, i2cdevlib, MicroPython and ESPHome: their arithmetic, restated from their sources, on numbers."""

import ast
import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import yaml

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RefusedError, WriteBackError
from mpucal.export.forms import form
from mpucal.export.vio import rotation_and_lower

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


def test_a_matrix_is_a_rotation_and_a_lower_triangle():
    for M in np.random.default_rng(6).normal(np.eye(3), 0.3, (50, 3, 3)):
        Q, L = rotation_and_lower(M)
        np.testing.assert_allclose(Q @ L, M, atol=1e-12)
        np.testing.assert_allclose(np.triu(L, 1), 0.0, atol=1e-12)
        assert (np.diag(L) > 0).all()


@pytest.mark.parametrize("name", ["kalibr", "openvins"])
@pytest.mark.parametrize("changes", [{"quality": {"verdict": "refused"}}, {"D": np.ones((3, 3))}])
def test_what_must_not_be_used_is_not_exported(calibration, name, changes):
    with pytest.raises(RefusedError, match="nothing was exported"):
        form(name).export(replace(calibration, **changes))


@pytest.mark.parametrize("name", ["kalibr", "openvins"])
def test_noise_that_nobody_knows_is_not_made_up(calibration, name):
    with pytest.raises(WriteBackError, match="does not say the noise"):
        form(name).export(replace(calibration, gyro_noise_std=np.full(3, np.nan)))


MPU6050_H = """
#include <stdio.h>
struct MPU6050 {
    void setXAccelOffset(short v) { printf("%d ", v); } void setYAccelOffset(short v) { printf("%d ", v); }
    void setZAccelOffset(short v) { printf("%d\\n", v); } void setXGyroOffset(short v) { printf("%d ", v); }
    void setYGyroOffset(short v) { printf("%d ", v); } void setZGyroOffset(short v) { printf("%d\\n", v); }
};
"""


def test_the_registers_that_i2cdevlib_sets_take_the_biases_away(calibration, samples, tmp_path):
    if shutil.which("g++") is None:
        pytest.skip("needs g++")
    (tmp_path / "MPU6050.h").write_text(MPU6050_H)
    (tmp_path / "offsets.h").write_text(form("i2cdevlib").export(calibration)[0])
    (tmp_path / "main.cpp").write_text('#include "offsets.h"\nint main() { MPU6050 mpu; setOffsets(mpu); }\n')
    subprocess.run(["g++", "-Wall", "-Werror", "-I.", "-o", "program", "main.cpp"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "program"], capture_output=True, text=True, check=True).stdout
    a_words, w_words = (np.array(line.split(), int) for line in said.splitlines())
    trim = np.array(calibration.sensor.accel_offsets)
    assert ((a_words ^ trim) & 1 == 0).all()
    # of the register maps: 2048 counts to 1 g, and 4 / 131 deg/s a count, added to what is measured
    a = samples + (a_words - trim) / 2048 * G
    w = RATES + np.radians(w_words * 4 / 131)
    assert np.abs(a - (samples - calibration.b_a)).max() <= 1.001 * G / 2048
    assert np.abs(w - (RATES - calibration.b_omega)).max() <= 0.501 * np.radians(4 / 131)


def test_offsets_without_the_factorys_trim_are_not_made_up(calibration):
    with pytest.raises(WriteBackError, match="does not say what the accelerometer's offset registers held"):
        form("i2cdevlib").export(replace(calibration, sensor=replace(calibration.sensor, accel_offsets=None)))


def test_the_micropython_module_needs_nothing(calibration, samples):
    text, _ = form("micropython").export(calibration)
    assert not [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    module = {}
    exec(text, module)
    a, w = calibration.apply(samples, RATES)
    np.testing.assert_allclose([module["apply"](y) for y in samples.tolist()], a, atol=1e-6)
    np.testing.assert_allclose([module["apply_gyro"](y) for y in RATES.tolist()], w, atol=1e-6)


def test_esphomes_lambdas_compiled_and_fed_with_counts(calibration, tmp_path):
    if shutil.which("g++") is None:
        pytest.skip("needs g++")
    measured, *made = yaml.safe_load(form("esphome").export(calibration)[0])["sensor"]
    assert measured["platform"] == "mpu6050"
    assert [measured[f"accel_{axis}"]["id"] for axis in "xyz"] == ["measured_x", "measured_y", "measured_z"]
    assert [sensor["platform"] for sensor in made] == ["template"] * 3
    # ESPHome makes id(name) an access to the component, and the lambda a function that returns optional<float>
    bodies = [re.sub(r"id\((\w+)\)", r"\1", sensor["lambda"]) for sensor in made]
    functions = "".join(f"float f{i}() {{ {body} }}\n" for i, body in enumerate(bodies))
    (tmp_path / "main.cpp").write_text(
        "#include <cstdio>\nstruct { float state; } measured_x, measured_y, measured_z;\n"
        + functions
        + 'int main() { int x, y, z; while (scanf("%d %d %d", &x, &y, &z) == 3) {\n'
        "measured_x.state = (short)x * 0.000061f * 9.80665f; measured_y.state = (short)y * 0.000061f * 9.80665f;\n"
        'measured_z.state = (short)z * 0.000061f * 9.80665f; printf("%.9g %.9g %.9g\\n", f0(), f1(), f2()); } }\n'
    )
    subprocess.run(["g++", "-Wall", "-Werror", "-o", "program", "main.cpp"], cwd=tmp_path, check=True)
    counts = np.random.default_rng(7).integers(-32768, 32768, (100, 3))
    fed = "".join(f"{x} {y} {z}\n" for x, y, z in counts)
    said = subprocess.run([tmp_path / "program"], input=fed, capture_output=True, text=True, check=True).stdout
    a = np.array([line.split() for line in said.splitlines()], float)
    np.testing.assert_allclose(a, calibration.apply(counts * G / 16384), atol=2e-5)
