"""Sessions on a sensor of the kernel, simulated: good, replayed to the bit, and examined."""

import json

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run

DATES = ("created",)


def session(capsys, *words):
    code = run(["session", *words, "--yes", "--json", "--json-events"])
    found = json.loads(capsys.readouterr().out)
    return code, {key: value for key, value in found.items() if key not in DATES}


def test_a_session_ends_good_and_replays_to_the_bit(tmp_path, capsys):
    made, again = tmp_path / "made", tmp_path / "again"
    words = ["--iio", "sim:temperature_c=27", "--seed", "4", "--rate", "25", "--target", "quick", "--model", "hand"]
    code, found = session(capsys, *words, "-o", str(made))
    truth = json.loads((made / "truth.json").read_text())
    assert code == 0
    assert found["quality"]["verdict"] == "good"
    assert found["sensor"]["chip"] == "MPU-6050"
    assert (found["sensor"]["accel_range_g"], found["sensor"]["gyro_range_dps"]) == (4, 500)
    assert found["sensor"]["temperature_c"] == pytest.approx(27, abs=0.3)
    assert np.abs(np.array(found["accelerometer"]["D"]) - truth["D"]).max() < 2e-3
    assert session(capsys, "--replay", str(made), "-o", str(again)) == (code, found)
    live, later = mpucal.load(made / "capture.mcap"), mpucal.load(again / "capture.mcap")
    assert live == later
    # counts, whatever the scale: nothing was lost on the way
    counts = live.acc / (9.80665 / 8192)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-2)


@pytest.mark.parametrize("trigger", [(), ("--trigger", "none")], ids=["buffered", "polled"])
def test_the_doctor_examines_it(capsys, trigger):
    assert run(["doctor", "--iio", "sim:hand=still", "--seconds", "4", "--json", *trigger]) == 0
    told = {finding["topic"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}
    assert {"iio:device0", "ranges", "sample rate", "losses", "at rest"} <= set(told)
    assert ("buffer" in told) is (not trigger)
    assert told["sample rate"]["mark"] == "ok"
    assert told["iio:device0"]["data"]["in_accel_scale"]
    assert not [topic for topic, finding in told.items() if finding["mark"] == "bad"]
