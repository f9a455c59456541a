"""Sessions that are interrupted and resumed: nothing is lost, and the bits are those of an unbroken session."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.files import load
from mpucal.files.mcap import read_capture
from mpucal.result.calibration import Calibration

STORED = Path(__file__).parents[2] / "fixtures" / "sessions" / "enter.mcap"
WORDS = ("session", "--json-events", "--yes")


def events(err):
    return [json.loads(line) for line in err.splitlines() if line.startswith("{")]


def came_to_s(err):
    return max(event.get("t_s", 0.0) for event in events(err))


def last_s(capture):
    return read_capture(capture).records[-1].t_ns * 1e-9


def joined(write_capture, folder, names):
    """Write one capture with the records of all; return its path."""
    captures = [read_capture(folder / name) for name in names]
    records = [record for capture in captures for record in capture.records]
    return write_capture(folder.parent / "joined.mcap", captures[0].meta, records)


def test_a_resumed_session_has_the_bits_of_an_unbroken_one(mpucal, stopped_at, write_capture, tmp_path):
    """Kill the session while flat, and stop it with Ctrl-C while rotating: its result gets no reason for that."""
    folder = tmp_path / "board"
    words = ("--bus", "sim", "--rate", "25", "--target", "quick", "-o", "board", "--name", "Bench 7")
    killed_s = came_to_s(stopped_at(tmp_path, ("flat", 50), signal.SIGKILL, *WORDS, *words).err)
    assert killed_s > 3.0
    assert killed_s - last_s(folder / "capture.mcap") < 1.0
    stopped = stopped_at(tmp_path, ("rotate", 80), signal.SIGINT, *WORDS, "--resume", "board")
    assert stopped.code == 4
    stopped_s = came_to_s(stopped.err)
    assert stopped_s > 20.0
    assert stopped_s - last_s(folder / "capture-2.mcap") < 1.0

    kept = mpucal("calibrate", folder, "-o", folder)
    assert (kept.code, "could not be resumed" in kept.err) == (3, True)
    resumed = mpucal(*WORDS, "--resume", folder, code=0)
    for err, begins in ((stopped.err, "lay_flat"), (resumed.err, "rotate")):
        said = events(err)
        assert said[0]["event"] in ("note", "decision")
        assert "the session resumes where it stopped" in err
        prompts = [event["kind"] for event in said if event["event"] == "prompt"]
        assert prompts[0] == begins
    assert prompts[-2:] == ["verify", "rest"]

    found = Calibration.load(folder / "calibration.json")
    assert found.extra["name"] == "Bench 7"
    assert (found.verdict, found.quality["reasons"]) == ("good", [])
    parts, unbroken = (
        load(folder),
        load(joined(write_capture, folder, ("capture.mcap", "capture-2.mcap", "capture-3.mcap"))),
    )
    assert parts.at(slice(None)) == unbroken.at(slice(None))
    assert parts.interrupted == unbroken.interrupted
    assert parts.gap.sum() == len(parts.interrupted) == 2
    other = calibrate(unbroken)
    assert np.array_equal(other.D, found.D)
    assert np.array_equal(other.b_a, found.b_a)

    mpucal(*WORDS, "--replay", folder, "-o", "again", code=0)
    replayed = Calibration.load(tmp_path / "again" / "calibration.json")
    assert np.array_equal(replayed.D, found.D)
    assert replayed.quality["verification"] == found.quality["verification"]


@pytest.fixture
def cut_off(write_capture, tmp_path):
    """Return a function that writes the first seconds of a session's capture into the folder `cut`."""

    def call(folder, cut_s):
        whole = read_capture(folder / "capture.mcap")
        until_ns = whole.records[0].t_ns + cut_s * 1e9
        (tmp_path / "cut").mkdir()
        kept = [record for record in whole.records if record.t_ns < until_ns]
        write_capture(tmp_path / "cut" / "capture.mcap", whole.meta, kept)

    return call


def resume_cut(mpucal, begins, gaps=1):
    """Resume the session in the folder `cut`; return its recording, that of the cut part, and its calibration.

    The simulated sensor stands where it was switched on, and its clock begins again. That the session was interrupted
    is no lost data; each further gap is.
    """
    resumed = mpucal(*WORDS, "--no-write", "--resume", "cut", code=0)
    assert "the session resumes where it stopped" in resumed.err
    prompts = [event["kind"] for event in events(resumed.err) if event["event"] == "prompt"]
    assert (prompts[0], prompts[-1]) == (begins, "rest")
    recording, first = load("cut"), load("cut/capture.mcap")
    assert recording.gap.sum() == gaps
    assert np.array_equal(first.acc, recording.acc[: len(first)])
    found = Calibration.load("cut/calibration.json")
    for quality in (found.quality, *(imu["quality"] for imu in found.extra.get("others", ()))):
        lost = [reason["message"] for reason in quality["reasons"] if reason["code"] == "data_lost"]
        assert len(lost) == (gaps > 1)
        assert all(f" in {gaps - 1} place" in message for message in lost)
    return recording, first, found


def test_a_vehicle_is_resumed_after_a_reboot_while_rotating(mpucal, flown, cut_off):
    cut_off(flown.folder, 25.0)
    resume_cut(mpucal, "rotate")


def test_samples_that_a_resumed_session_lost_are_told(mpucal, cut_off, tmp_path):
    words = ("--bus", "sim:fault=brownout@22", "--rate", "25", "--target", "quick", "--no-write")
    assert mpucal(*WORDS, *words, "-o", "whole").code == 0
    cut_off(tmp_path / "whole", 16.0)
    _, _, found = resume_cut(mpucal, "rotate", gaps=2)
    assert found.verdict == "usable"


def test_a_kernel_device_is_resumed_after_a_reboot(mpucal, cut_off, tmp_path):
    words = ("--iio", "sim:seed=3", "--rate", "25", "--target", "quick", "--no-write")
    assert mpucal(*WORDS, *words, "-o", "whole").code == 0
    cut_off(tmp_path / "whole", 20.0)
    recording, _, _ = resume_cut(mpucal, "rotate")
    assert np.all(np.diff(recording.t) > 0)


@pytest.mark.slow
def test_a_vehicle_of_two_imus_is_resumed_after_a_reboot_while_flat(mpucal, cut_off, tmp_path):
    words = ("--mavlink", "sim:firmware=px4,imus=2,seed=3", "--rate", "50", "--target", "quick", "--no-write")
    assert mpucal(*WORDS, *words, "--prepare=yes", "-o", "whole").code == 0
    cut_off(tmp_path / "whole", 6.0)
    recording, first, found = resume_cut(mpucal, "lay_flat")
    mpucal(*WORDS, "--replay", "cut", "-o", "again", code=0)
    assert Calibration.load("again/calibration.json").quality["verification"] == found.quality["verification"]
    assert np.array_equal(first.others[0].gyr, recording.others[0].gyr[: len(first.others[0])])
    for other in (calibrate(recording), calibrate(load("again"))):
        assert np.array_equal(other.D, found.D)
    mpucal("check", "whole/calibration.json", "--replay", "whole", "--yes", code=0)


def test_a_capture_without_a_source_cannot_be_resumed(mpucal, write_capture, tmp_path):
    capture = read_capture(STORED)
    (tmp_path / "old").mkdir()
    meta = {key: value for key, value in capture.meta.items() if key != "source"}
    write_capture(tmp_path / "old" / "capture.mcap", meta, [])
    result = mpucal("session", "--resume", "old", code=2)
    assert "does not name its source" in result.err


@pytest.mark.parametrize(
    ("words", "code", "what"),
    [
        (["--bus", "sim:hand=restless", "--rate", "10"], 4, "the board was not still for 10 s within 60 s"),
        (["--bus", "/dev/i2c-99"], 3, "there is no I2C bus /dev/i2c-99"),
        (["--bos", "sim"], 2, "No such option '--bos'"),
    ],
    ids=["abandoned", "no bus", "wrong usage"],
)
def test_errors_are_events_too(mpucal, words, code, what):
    result = mpucal("session", "--json-events", *words)
    *_, error = [json.loads(line) for line in result.err.splitlines()]
    assert (result.code, error["event"], error["exit_code"]) == (code, "error", code)
    assert what in error["what"]
    assert error["remedy"]
