"""A session over MAVLink writes to the autopilot that it measured, or leaves it unchanged and ends with 6."""

import json

import numpy as np

from mpucal.result.calibration import Calibration
from mpucal.result.journal import Journal
from mpucal.sinks.choose import interrupted_writes
from mpucal.sources.table import matching_kinds

OPTIONS = {
    **dict.fromkeys(("bus", "serial", "replay", "system", "signing_key", "address", "seed")),
    **{"rate": 200.0, "accel_range": "4", "gyro_range": "500", "dlpf": 3, "gravity": 9.80665, "model": "auto"},
}


def test_a_session_sets_the_parameters_and_notes_them_in_its_files(flown):
    assert flown.code == 0, flown.err
    document = json.loads(flown.out)
    assert document == json.loads((flown.folder / "calibration.json").read_text())
    (entry,) = document["written"]
    assert entry["to"] == "autopilot"
    assert "read back and verified in its streams" in entry["what"]
    assert "Results are written to files and the autopilot" in flown.err
    assert "its horizon agrees with gravity within" in entry["what"]


def test_a_session_with_a_vehicle_does_not_speak_of_a_board(flown):
    assert "Put the vehicle on its feet on a firm surface" in flown.err
    assert "board" not in flown.err
    # This file is of the samples that were measured, as truth.json is; the other one is of the streams from now on.
    truth = json.loads((flown.folder / "truth.json").read_text())
    measured = Calibration.load(flown.folder / "calibration.json")
    now = Calibration.load(flown.folder / "calibration-on-autopilot.json")
    np.testing.assert_allclose(measured.D, truth["D"], atol=0.005)
    assert np.abs(now.b_a).max() < 0.02 < np.abs(measured.b_a).max()
    assert now.extra["autopilot"]["params_old"].items() >= measured.extra["autopilot"]["params_new"].items()


def test_a_recording_before_the_write_takes_the_calibration_before_it(flown, mpucal):
    assert mpucal("apply", flown.folder / "calibration.json", flown.folder, "-o", "a.npz").code == 0
    other = mpucal("apply", flown.folder / "calibration-on-autopilot.json", flown.folder, "-o", "b.npz", code=2)
    assert "while these samples were taken" in other.err


def test_an_interrupted_write_is_reported_before_the_next_session():
    options = {**OPTIONS, "mavlink": "sim:imus=1,seed=77"}
    kind = matching_kinds(options)[0]
    assert list(interrupted_writes(kind, options)) == []
    journal = Journal.of("autopilot", "sim:imus=1,seed=77")
    journal.begin({"old": {}, "new": {}})
    (sentence,) = interrupted_writes(kind, options)
    journal.end()
    assert "a write to the autopilot was cut off" in sentence
    assert "first restores the old" in sentence
