"""The trial of strangers' recordings, on files of known samples."""

import numpy as np
import pytest

from tools.lab import rivals, strangers
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2


@pytest.fixture(scope="module")
def made():
    return hand_scenario(1, "pose12", rate_hz=50.0).recording


def test_a_rest_is_judged_by_an_ellipsoid_of_the_others(made):
    rests = rivals.Rests.of(made)
    fitted = rivals.ellipsoid(rests, GRAVITY_MPS2)
    of_all = np.linalg.norm(np.linalg.solve(fitted.D, (rests.y - fitted.b_a).T), axis=0) - GRAVITY_MPS2
    assert 1e3 * np.sqrt(np.mean(of_all**2)) < strangers.left_out(rests, GRAVITY_MPS2) < 100.0
    assert np.isnan(strangers.left_out(rivals.Rests(rests.recording, rests.flat, rests.runs[:6]), GRAVITY_MPS2))


@pytest.mark.parametrize(("unit", "tries"), [("", 1), (" (rad/s)", 2)])
def test_a_try_follows_the_options_of_the_refusal(unit, tries, made, tmp_path):
    names = ",".join(["time", *(f"acc_{axis}" for axis in "xyz"), *(f"gyro_{axis}{unit}" for axis in "xyz")])
    rows = np.column_stack([made.t, made.acc, np.degrees(made.gyr)])
    np.savetxt(tmp_path / "walk.csv", rows, "%.9g", ",", header=names, comments="")
    found = strangers.of_path(tmp_path / "walk.csv", gravity=GRAVITY_MPS2)
    assert found.tries == tries
    assert found.before > 10.0 * found.after
    (tmp_path / "note.txt").write_text("no table\n")
    assert strangers.of_path(tmp_path / "note.txt").tries == 0
