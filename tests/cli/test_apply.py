"""`mpucal apply`: the formula on every kind of file, and no bias that is removed twice."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.data import STANDARD_GRAVITY_MPS2
from mpucal.files import load
from mpucal.result.calibration import Calibration

D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
B_A = np.array([0.31, -0.22, 1.08])
K = np.array([[1.01, 0.002, 0.0], [0.002, 0.98, -0.004], [0.0, -0.004, 1.0]])
B_OMEGA = np.array([0.02, -0.03, 0.01])


@pytest.fixture
def calibration(tmp_path):
    made = Calibration(D, B_A, K=K, b_omega=B_OMEGA, quality={"verdict": "good", "reasons": []})
    made.save(tmp_path / "c.json")
    made.save(tmp_path / "c.bin")
    return made


def formula(recording):
    """Equation 4 of the paper, as NumPy has it."""
    return (recording.acc - B_A) @ np.linalg.inv(D).T, (recording.gyr - B_OMEGA) @ K.T


def test_a_real_recording_comes_out_as_the_formula_says(mpucal, calibration, shared):
    (path,) = shared("recordings/mpu9150_a.npz")
    assert mpucal("apply", "c.json", path, "-o", "out.npz").code == 0
    recording, out = load(path), load("out.npz")
    acc, gyr = formula(recording)
    # Runs of rows are multiplied in another order than all rows at once.
    np.testing.assert_allclose(out.acc, acc, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(out.gyr, gyr, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(out.t, recording.t)


@pytest.mark.parametrize(("name", "ending"), [("c.json", ".csv"), ("c.bin", ".npz")])
def test_a_capture_goes_into_every_kind(mpucal, session, calibration, name, ending):
    done = mpucal("apply", name, session.folder, "-o", f"out{ending}", "--json", code=0)
    recording, out = load(session.folder), load(f"out{ending}")
    acc, gyr = formula(recording)
    exact = 1e-12 if name == "c.json" else 1e-5
    np.testing.assert_allclose(out.acc, acc, atol=exact)
    np.testing.assert_allclose(out.gyr, gyr, atol=exact)
    facts = json.loads(done.out)
    assert facts["samples"] == len(recording)
    assert facts["mean_after_mps2"] == pytest.approx(np.linalg.norm(acc, axis=1).mean(), abs=1e-5)


def test_a_table_goes_to_stdout(mpucal, save, session, calibration, tmp_path):
    recording = load(session.folder).part(0, 500)
    save(recording, "dated.csv")
    save(replace(recording, utc_ns=None), "in.csv")
    assert "time of day" not in mpucal("apply", "c.json", "dated.csv").err
    done = mpucal("apply", "c.json", "in.csv", code=0)
    assert "in.csv holds no time of day" in done.err
    (tmp_path / "out.csv").write_text(done.out)
    np.testing.assert_allclose(load("out.csv").acc, formula(recording)[0], atol=1e-12)


def as_text(rows, path):
    names = "time,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z"
    np.savetxt(path, rows, delimiter=",", header=names, comments="")


FORMS = {".csv": as_text, ".npy": np.save}


@pytest.mark.parametrize("ending", FORMS)
def test_missing_numbers_stay_missing_in_every_format(mpucal, session, calibration, ending):
    """Leave out one number, one sample and two seconds of a recording in g and deg/s."""
    recording = load(session.folder)
    rows = np.column_stack([recording.t, recording.acc / STANDARD_GRAVITY_MPS2, np.degrees(recording.gyr)])
    rows = np.delete(rows, slice(3000, 3200), axis=0)
    rows[1207, 2] = rows[1300, 1:] = np.nan
    path = Path(f"in{ending}")
    FORMS[ending](*((path, rows) if ending == ".npy" else (rows, path)))
    done = mpucal("apply", "c.json", path, "-o", "out.npz", code=0)
    assert f"{len(rows)} samples, 2 of which lack a number" in done.out
    with np.load("out.npz") as out:
        assert np.flatnonzero(np.isnan(out["acc"]).any(1)).tolist() == [1207, 1300]
        whole = np.isfinite(out["acc"]).all(1)
        wanted = np.delete(formula(recording)[0], slice(3000, 3200), axis=0)
        np.testing.assert_allclose(out["acc"][whole], wanted[whole], atol=1e-9)
        np.testing.assert_allclose(np.diff(out["t"]), np.diff(rows[:, 0]), atol=1e-7)
    read = load(path)
    assert len(read) == len(rows) - 2
    assert np.flatnonzero(read.gap).tolist() == [2998]


def test_samples_that_lack_a_number_are_carried_into_a_capture(mpucal, save, session, calibration):
    recording = load(session.folder).part(0, 500)
    recording.acc[7, 1] = recording.gyr[9, 2] = np.nan
    save(recording, "in.npz")
    assert "500 samples, 2 of which lack a number" in mpucal("apply", "c.json", "in.npz", "-o", "out.mcap").out


def test_b_a_follows_the_temperature(mpucal, session, calibration):
    recording = load(session.folder)
    slope, at = np.array([0.01, -0.02, 0.03]), float(recording.temperature_c.mean()) - 5.0
    warm = replace(
        calibration,
        b_a_slope=slope,
        temperature_range_c=np.array([at - 1.0, at + 9.0]),
        sensor=replace(calibration.sensor, temperature_c=at),
    )
    warm.save("warm.json")
    assert mpucal("apply", "warm.json", session.folder, "-o", "out.npz").code == 0
    b_a = B_A + (recording.temperature_c - at)[:, None] * slope
    np.testing.assert_allclose(load("out.npz").acc, (recording.acc - b_a) @ np.linalg.inv(D).T, atol=1e-12)


@pytest.mark.parametrize("ending", [".npz", ".csv", ".mcap"])
def test_calibrated_recordings_are_refused(mpucal, save, session, calibration, ending):
    save(load(session.folder).part(0, 500), "in.npz")
    mpucal("apply", "c.json", "in.npz", "-o", f"out{ending}")
    again = mpucal("apply", "c.json", f"out{ending}", "-o", "twice.npz", code=2)
    why = "as its column calibrated_by_mpucal says" if ending == ".csv" else "calibrated with c.json of"
    assert f"calibrated already ({why}" in again.err
    assert "a new calibration is of the errors that are left" in mpucal("show", f"out{ending}").err


def test_a_table_whose_times_begin_anew_is_applied_to(mpucal, save, session, calibration):
    """Go on after a gap, as `calibrate` does, also where a run of samples ends."""
    recording = load(session.folder)
    half = len(recording) // 2
    t = recording.t - np.where(np.arange(len(recording)) < half, recording.t[0], recording.t[half])
    save(replace(recording, t=t, utc_ns=None), "in.csv")
    done = mpucal("apply", "c.json", "in.csv", "-o", "out.csv")
    assert (done.code, "its times restart once" in done.err) == (0, True), done.err
    read, out = load("in.csv"), load("out.csv")
    np.testing.assert_array_equal(read.t, out.t)
    np.testing.assert_allclose(out.acc, formula(recording)[0], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "code", "says"),
    [
        ({"quality": {"verdict": "refused"}}, 2, "refused"),
        ({"who_am_i": 0x70}, 2, "WHO_AM_I"),
        ({"accel_offsets": (2, 4, 6)}, 2, "offset registers held"),
        ({"accel_offsets": (2, 4, 6), "applied_in_hardware": B_A}, 0, ""),
        ({"applied_in_hardware": B_A}, 0, "factory trim again"),
    ],
    ids=["refused", "another chip", "other registers", "registers that it knows", "registers that a reset cleared"],
)
def test_a_calibration_that_does_not_belong(mpucal, session, calibration, changes, code, says):
    recording = load(session.folder)
    sensor = replace(recording.sensor, **{k: changes.pop(k) for k in ("who_am_i", "accel_offsets") if k in changes})
    registers_differ = sensor.accel_offsets != recording.sensor.accel_offsets
    replace(calibration, sensor=sensor, **changes).save("other.json")
    done = mpucal("apply", "other.json", session.folder, "-o", "out.npz", code=code)
    assert says in done.err
    if code == 0:
        # The part of b_a that the registers subtract is not subtracted again; after a reset they subtract nothing.
        left = B_A - (B_A if registers_differ else 0.0)
        np.testing.assert_allclose(load("out.npz").acc, (recording.acc - left) @ np.linalg.inv(D).T, atol=1e-12)


def test_no_input_is_overwritten(mpucal, save, session, calibration):
    save(load(session.folder).part(0, 100), "in.npz")
    Path("board7").mkdir()
    shutil.copy(session.folder / "capture.mcap", "board7")
    shutil.copy("c.json", "calibration.json")
    before = {path: path.read_bytes() for path in Path().rglob("*.*")}
    for words in (
        "apply c.json in.npz -o in.npz",
        "apply c.json board7 -o board7/capture.mcap",
        "export c.json --to c-header -o c.json",
        "merge calibration.json c.json -o .",
    ):
        refused = mpucal(*words.split())
        assert refused.code == 2 and "input" in refused.err
    assert {path: path.read_bytes() for path in Path().rglob("*.*")} == before


def test_missing_files_are_exit_code_3(mpucal, calibration):
    for words in ("c.json walk.npz", "none.json walk.npz", "c.json x.txt -o y.csv"):
        assert mpucal("apply", *words.split()).code == 3
