import json
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.calibration import Calibration

RATE_HZ, FLAT_S, TURN_S = 100.0, 10.0, 10.0


def turning(n_turns=3, noise=0.05):
    """Ten seconds flat, then a turn about each axis: t, acc, gyr of a perfect sensor but for noise."""
    rng = np.random.default_rng(1)
    up, acc, gyr = np.array([0.0, 0.0, 1.0]), [], []
    for axis, seconds in [(None, FLAT_S), *((k % 3, TURN_S) for k in range(n_turns))]:
        rate = np.zeros(3)
        if axis is not None:
            rate[axis] = 2 * np.pi / seconds
        for _ in range(int(seconds * RATE_HZ)):
            acc.append(9.80665 * up)
            gyr.append(rate)
            up = up + np.cross(up, rate) / RATE_HZ
            up = up / np.linalg.norm(up)
    acc, gyr = np.array(acc), np.array(gyr)
    t = np.arange(len(acc)) / RATE_HZ
    return {
        "t": t,
        "acc": acc + noise * rng.normal(size=acc.shape),
        "gyr": gyr + 0.02 * noise * rng.normal(size=gyr.shape),
    }


def with_(**changes):
    return lambda arrays: {**arrays, **{key: change(arrays[key].copy()) for key, change in changes.items()}}


def contents(folder):
    """Return the bytes of each file, to compare them after a command."""
    return {path: path.read_bytes() for path in folder.iterdir()}


def test_files_without_a_recording_are_exit_code_3(mpucal, tmp_path):
    for change, sentence in (
        (with_(acc=lambda acc: acc * np.nan), "lacks a number in every sample"),
        (with_(gyr=lambda gyr: gyr[1:]), "gyr has shape (3999, 3), not (4000, 3)"),
    ):
        np.savez(tmp_path / "walk.npz", **change(turning()))
        result = mpucal("calibrate", "walk.npz")
        assert (result.code, result.out, result.err.count("\n")) == (3, "", 1)
        assert sentence in result.err


REFUSED = {
    "never still": (
        with_(acc=lambda a: a[1200:2900], gyr=lambda g: g[1200:2900], t=lambda t: t[1200:2900]),
        "never_still",
    ),
    "never turned": (with_(acc=lambda a: a[:900], gyr=lambda g: g[:900], t=lambda t: t[:900]), "few_orientations"),
}


@pytest.mark.parametrize(("change", "code"), REFUSED.values(), ids=REFUSED.keys())
def test_a_refusal_has_its_reason(mpucal, tmp_path, change, code):
    np.savez(tmp_path / "walk.npz", **change(turning()))
    result = mpucal("calibrate", "walk.npz", "--json", "-o", "out", code=5)
    assert code in [reason["code"] for reason in json.loads(result.out)["quality"]["reasons"]]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["calibration.json", "report.html"]
    shown = mpucal("calibrate", "walk.npz")
    assert shown.out.startswith("The calibration is refused:")
    assert shown.out.endswith("and run\n  mpucal calibrate walk-2.npz\n")
    elsewhere = mpucal("calibrate", "walk.npz", "--model", "hand", "-o", "out").out.splitlines()[-1]
    assert elsewhere == "  mpucal calibrate walk-2.npz --model hand -o out-2"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            with_(gyr=np.degrees, acc=lambda acc: acc / 9.80665),
            "acc was read in g, which its values suggest; gyr was read in",
        ),
        (with_(t=lambda t: t + np.random.default_rng(1).exponential(3e-3, len(t))), "arrival stamps, 3"),
    ],
    ids=["g and deg/s", "stamps of arrival"],
)
def test_odd_units_and_time_stamps_are_corrected_with_a_message(mpucal, tmp_path, change, says):
    arrays = change(turning())
    np.savez(tmp_path / "walk.npz", **{**arrays, "t": np.maximum.accumulate(arrays["t"])})
    result = mpucal("calibrate", "walk.npz", "--json", code=0)
    assert says in result.err
    assert json.loads(result.out)["quality"]["verdict"] in ("good", "usable")


def test_a_folder_of_a_session_is_read_as_its_capture(mpucal, session):
    result = mpucal("calibrate", session.folder, "--json", code=0)
    offline, online = json.loads(result.out), json.loads((session.folder / "calibration.json").read_text())
    assert offline["accelerometer"]["D"] == online["accelerometer"]["D"]


def test_the_present_folder_is_called_by_its_name(mpucal, tmp_path):
    for name in ("a.npz", "b.npz"):
        np.savez(tmp_path / name, **REFUSED["never turned"][0](turning()))
    result = mpucal("calibrate", ".", code=5)
    assert f"{tmp_path.name} was read as one recording of 2 files" in result.err
    assert f"mpucal calibrate {tmp_path}-2" in result.out + result.err


def test_a_folder_holds_the_results_of_one_recording(mpucal, session, tmp_path):
    """Results are not written beside the capture of another recording, nor over the results of another one."""
    np.savez(tmp_path / "walk.npz", **turning())
    np.savez(tmp_path / "other.npz", **REFUSED["never turned"][0](turning(noise=0.04)))
    for model in ("auto", "accel"):
        assert "Written to out/deep" in mpucal("calibrate", "walk.npz", "-o", "out/deep", "--model", model).out
    loaded = Calibration.load(tmp_path / "out" / "deep" / "calibration.bin")
    assert np.abs(loaded.D - np.eye(3)).max() < 0.01
    assert {path.name for path in tmp_path.iterdir()} == {"walk.npz", "other.npz", "out"}
    for folder in (session.folder, tmp_path / "out" / "deep"):
        before = contents(folder)
        result = mpucal("calibrate", "other.npz", "-o", folder, code=3)
        assert f"`mpucal calibrate other.npz -o {folder}-2` puts these elsewhere" in result.err
        assert contents(folder) == before
    # Without the document the results have no owner; a refusal leaves the blob, and says so.
    (loaded_from := tmp_path / "out" / "deep" / "calibration.bin").with_suffix(".json").unlink()
    before = loaded_from.read_bytes()
    assert "of an earlier calibration" in mpucal("calibrate", "other.npz", "-o", "out/deep").err
    assert loaded_from.read_bytes() == before


def test_an_updated_calibration_is_not_written_beside_a_capture(mpucal, session):
    """Refuse it even beside the capture that the calibration was made from."""
    calibration = session.folder / "calibration.json"
    copy, words = Path("copy.json"), ("check", "copy.json", session.folder / "capture.mcap")
    copy.write_bytes(calibration.read_bytes())
    before = contents(session.folder)
    result = mpucal(*words, "-o", session.folder, code=3)
    assert f"`mpucal {' '.join(map(str, words))} -o {session.folder}-2` puts" in result.err
    for name in ("calibration.json", "calibration.bin"):
        result = mpucal("check", session.folder / name, session.folder, "-o", session.folder)
        assert (result.code, "is an input file" in result.err) == (2, True)
    assert contents(session.folder) == before


def test_a_finished_session_is_not_gone_on_with(mpucal, session):
    before = contents(session.folder)
    result = mpucal("session", "--resume", session.folder, code=2)
    assert "is finished" in result.err
    assert f"-o {session.folder}-2" in result.err
    assert contents(session.folder) == before
