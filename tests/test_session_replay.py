"""A session and its replay: the same words, the same bits; on each kind of source of registers."""

import json
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.files.mcap import read_capture

SESSIONS = Path(__file__).parents[1] / "fixtures" / "sessions"
NAMES = sorted(path.stem for path in SESSIONS.glob("*.mcap"))
LSB_MPS2 = 4 * 9.80665 / 32768


class Outcome:
    """Output and result of a session, and its folder."""

    def __init__(self, folder, out, err):
        events = [json.loads(line) for line in err.splitlines()]
        self.said = [event for event in events if event["event"] in ("prompt", "decision")]
        # the last decision names the files that a session leaves
        assert self.said.pop()["why"].startswith("wrote ")
        self.document = {key: value for key, value in json.loads(out).items() if key != "created"}
        self.D = np.array(self.document["accelerometer"]["D"])
        self.capture, self.truth = folder / "capture.mcap", folder / "truth.json"


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


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_session_replays(session, name):
    """Machines read JSON alone, and a folder that nobody named is named by the chip."""
    stored = json.loads((SESSIONS / f"{name}.json").read_text())
    replayed = session("once", "--replay", SESSIONS / f"{name}.mcap")
    document = replayed.document
    assert replayed.said == stored["said"]
    assert document["format"] == "mpucal.calibration"
    assert replayed.capture.parent.name.startswith(f"{document['sensor']['chip'].lower()}-")
    assert (document["quality"]["verdict"], document["fit"]["samples"]) == (stored["verdict"], stored["samples"])
    np.testing.assert_allclose(replayed.D, stored["D"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(document["accelerometer"]["b_a"], stored["b_a"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("source", "chip", "model", "codes"),
    [
        pytest.param(["--iio", "sim:temperature_c=27"], "MPU-6050", "hand", [], id="iio"),
        *(
            pytest.param(["--bus", f"sim:temperature_c=27,{keys}"], *others, marks=pytest.mark.slow, id=keys)
            for keys, *others in (
                ("chip=mpu6500", "MPU-6500", "hand", []),
                ("chip=clone98", "ICM-20689", "accel", ["inconsistent"]),
                ("fault=no_fifo/nack@9", "MPU-6050", "hand", ["data_lost"]),
            )
        ),
    ],
)
def test_a_replay_equals_its_session_to_the_last_bit(session, source, chip, model, codes):
    """Replay sessions on each kind of access to samples; on an MPU-6050's FIFO: tests/cli/test_session.py."""
    live = session("live", *source, "--seed", 4, "--rate", 25, "--target", "quick", "--model", model)
    sensor, found = live.document["sensor"], mpucal.load(live.capture)
    assert (sensor["chip"], sensor["accel_range_g"], sensor["gyro_range_dps"]) == (chip, 4, 500)
    assert sensor["temperature_c"] == pytest.approx(27, abs=0.3)
    assert [reason["code"] for reason in live.document["quality"]["reasons"]] == codes
    assert found.gap.sum() == codes.count("data_lost")
    # counts, whatever the scale: nothing was lost on the way
    np.testing.assert_allclose(found.acc / LSB_MPS2, np.round(found.acc / LSB_MPS2), atol=1e-2)
    if model == "hand":
        assert np.abs(live.D - json.loads(live.truth.read_text())["D"]).max() < 2e-3
    replayed = session("replayed", "--replay", live.capture)
    assert (replayed.said, replayed.document) == (live.said, live.document)
    assert read_capture(replayed.capture).records == read_capture(live.capture).records
