"""A session and its replay: the same words, the same bits; on chips of two families."""

import json
from pathlib import Path

import numpy as np
import pytest

from mpucal.__main__ import run
from mpucal.files.mcap import read_capture

SESSIONS = Path(__file__).parents[1] / "fixtures" / "sessions"
NAMES = sorted(path.stem for path in SESSIONS.glob("*.mcap"))


class Outcome:
    """Output, result and capture of a session."""

    def __init__(self, folder, out, err):
        events = [json.loads(line) for line in err.splitlines()]
        self.said = [event for event in events if event["event"] in ("prompt", "decision")]
        document = json.loads(out)
        self.format = document["format"]
        self.sensor = document["sensor"]
        self.verdict = document["quality"]["verdict"]
        self.D = np.array(document["accelerometer"]["D"])
        self.b_a = np.array(document["accelerometer"]["b_a"])
        self.samples = document["fit"]["samples"]
        self.folder = folder
        self.records = read_capture(folder / "capture.mcap").records


@pytest.fixture
def session(capsys, tmp_path, monkeypatch):
    """A session by these words; it names its folder itself."""

    def call(name, *words):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        run(["session", *map(str, words), "--yes", "--json", "--json-events"])
        captured = capsys.readouterr()
        (folder,) = (tmp_path / name).iterdir()
        return Outcome(folder, captured.out, captured.err)

    return call


def without_writing(said):
    """Return the events without the last decision, which names the files that a session leaves."""
    assert said[-1]["why"].startswith("wrote ")
    return said[:-1]


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_session_replays(session, name):
    """Machines read JSON alone, and a folder that nobody named is named by the chip."""
    stored = json.loads((SESSIONS / f"{name}.json").read_text())
    replayed = session("once", "--replay", SESSIONS / f"{name}.mcap")
    assert without_writing(replayed.said) == stored["said"]
    assert replayed.format == "mpucal.calibration"
    assert replayed.folder.name.startswith(f"{replayed.sensor['chip'].lower()}-")
    assert (replayed.verdict, replayed.samples) == (stored["verdict"], stored["samples"])
    np.testing.assert_allclose(replayed.D, stored["D"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(replayed.b_a, stored["b_a"], rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chip", "model", "name"),
    [("mpu6500", "hand", "MPU-6500"), ("clone98", "accel", "ICM-20689")],
    ids=["mpu6500-hand", "clone98-accel"],
)
def test_a_replay_equals_its_session_to_the_last_bit(session, chip, model, name):
    """Replay two chips' sessions; that of an MPU-6050 is in tests/cli/test_session.py."""
    bus = f"sim:chip={chip},temperature_c=27"
    live = session("live", "--bus", bus, "--seed", 5, "--rate", 25, "--target", "quick", "--model", model)
    assert live.sensor["chip"] == name
    assert live.sensor["temperature_c"] == pytest.approx(27, abs=0.3)
    if model != "accel":
        truth = json.loads((live.folder / "truth.json").read_text())
        assert live.verdict == "good"
        assert np.abs(live.D - truth["D"]).max() < 2e-3
    replayed = session("replayed", "--replay", live.folder / "capture.mcap")
    assert without_writing(replayed.said) == without_writing(live.said)
    assert replayed.records == live.records
    assert np.array_equal(replayed.D, live.D)
    assert np.array_equal(replayed.b_a, live.b_a)
