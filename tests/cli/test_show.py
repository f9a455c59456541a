import json

import numpy as np
import pytest

from mpucal.cli.summary import files_written, formula, summary
from mpucal.result.calibration import Calibration


def calibration(verdict="good", **changes):
    D = np.eye(3) + np.array([[0.02, 0.001, 0.0], [0.0, -0.01, 0.0], [0.0, np.radians(1.0), 0.0]])
    quality = {
        "verdict": verdict,
        "reasons": []
        if verdict == "good"
        else [{"code": "gyro_clipped", "message": "18 gyro samples stood at full scale"}],
        "magnitude_before": {"median": 9.9, "mean": 9.91, "std": 0.21},
        "magnitude_after": {"median": 9.8, "mean": 9.807, "std": None},
    }
    values = {
        "D": D,
        "b_a": np.array([0.0980665, -0.5, 0.0]),
        "D_std": np.full((3, 3), 2e-4),
        "b_a_std": np.array([0.00980665, 0.02, np.nan]),
        "quality": quality,
        "fit": {"model": "accel", "samples": 4000, "seconds": 40.0, "gravity": 9.80665},
    }
    return Calibration(**{**values, **changes})


def row(text, name):
    return next(line for line in text.splitlines() if line.startswith(name))


def test_a_summary_is_in_the_units_of_people_and_fits_80_columns():
    text = summary(calibration())
    assert text.startswith("The calibration is good.")
    assert " ".join(row(text, "scale factor error, %").split()[4:]) == "+2.000 ± 0.020 -1.000 ± 0.020 +0.000 ± 0.020"
    assert row(text, "bias, mg").split()[2:] == ["+10.0", "±", "1.0", "-51.0", "±", "2.0", "+0.000", "±", "?"]
    assert row(text, "misalignment z->y, deg").endswith("+1.000 ± 0.011")
    assert max(map(len, text.splitlines())) < 80


@pytest.mark.parametrize("verdict", ["usable", "refused"])
def test_reservations_are_named(verdict):
    text = summary(calibration(verdict))
    assert verdict in text.splitlines()[0]
    assert "  - 18 gyro samples stood at full scale" in text


def test_nobody_judged_a_blob():
    text = summary(calibration(quality={}, fit={}))
    assert text.splitlines()[0].split() == ["value", "±", "1", "sigma", "x", "y", "z"]
    assert "calibration is" not in text


def test_unknown_numbers_are_called_unknown():
    assert "unknown" in row(summary(calibration(b_a=np.full(3, np.nan))), "bias")


def test_the_formula_calibrates():
    c = calibration()
    lines = formula(c).splitlines()[1:]
    y = dict(zip("xyz", (1.0, 2.0, 3.0), strict=True))
    matrix = [[float(value) for value in line[line.index("[") + 1 : line.index("]")].split()] for line in lines]
    shifted = []
    for axis, line in zip("xyz", lines, strict=True):
        shifted.append(y[axis] + float(line.split(f"y_{axis}")[1]))
    assert np.array(matrix) @ shifted == pytest.approx(c.apply([1.0, 2.0, 3.0]), abs=1e-4)


def test_what_is_next_depends_on_what_was_written(tmp_path):
    good = files_written([tmp_path / "calibration.json", tmp_path / "calibration.bin", tmp_path / "report.html"])
    assert "firmware" in good
    refused = files_written([tmp_path / "calibration.json", tmp_path / "report.html"])
    assert "firmware" not in refused
    assert "calibrate again" in refused


@pytest.mark.parametrize("name", ["calibration.json", "calibration.bin"])
def test_shows_a_calibration(mpucal, session, name):
    result = mpucal("show", session.folder / name)
    assert result.code == 0
    assert "a calibration of" in result.out
    assert "bias, mg" in result.out
    assert "inv(D)" in result.out
    assert ("The calibration is" in result.out) == name.endswith("json")


def test_shows_a_capture(mpucal, session):
    result = mpucal("show", session.folder)
    assert result.code == 0
    assert "MPU-6050, ±4 g, ±500 deg/s" in result.out
    assert "lies flat" in result.out
    facts = json.loads(mpucal("show", session.folder / "capture.mcap", "--json").out)
    assert facts["chip"] == "MPU-6050"
    assert facts["samples"] == pytest.approx(facts["seconds"] * facts["rate_hz"], rel=0.01)
    assert facts["flat_s"][1] - facts["flat_s"][0] > 5.0


def test_shows_a_recording_of_which_little_is_known(mpucal, tmp_path):
    rng = np.random.default_rng(0)
    np.savez(
        tmp_path / "walk.npz", t=np.arange(300) / 100.0, acc=rng.normal(size=(300, 3)), gyr=rng.normal(size=(300, 3))
    )
    result = mpucal("show", "walk.npz")
    assert result.code == 0
    assert "unnamed sensor" in result.out
    assert "lies flat     never" in result.out
    assert json.loads(mpucal("show", "walk.npz", "--json").out)["flat_s"] is None


@pytest.mark.parametrize("content", [b"{}", b"nonsense", b'{"format": "other"}'])
@pytest.mark.parametrize("name", ["c.json", "c.bin"])
def test_no_calibration_is_3(mpucal, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    result = mpucal("show", name)
    assert result.code == 3
    assert name in result.err
