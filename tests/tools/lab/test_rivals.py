"""Rival methods, and the trial of strangers' recordings that uses one, on a hand's poses of known samples."""

import numpy as np
import pytest

from tools.lab import rivals, strangers
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2


@pytest.fixture(scope="module")
def made():
    return hand_scenario(1, "pose12", rate_hz=50.0)


def of_runs(made, runs):
    """Return some of the rests of a recording."""
    rests = rivals.Rests.of(made.recording)
    return rivals.Rests(rests.recording, rests.flat, rests.runs[runs])


def test_turned_to_the_gyro_the_ellipsoid_gives_all_of_d(made):
    rests = rivals.Rests.of(made.recording)
    free, turned = (method(rests, GRAVITY_MPS2) for method in (rivals.ellipsoid, rivals.aligned_ellipsoid))
    assert np.abs(turned.D - made.truth.D).max() < 0.005 < np.abs(free.D - made.truth.D).max()
    np.testing.assert_allclose(turned.b_a, made.truth.b_a, atol=0.02)


@pytest.mark.parametrize(
    ("runs", "method", "why"),
    [
        ([0, 1], "six_positions", r"no rest with .*-z up"),
        (range(6), "ellipsoid", "6 rests, needs 9"),
        ([0, 1] * 5, "ellipsoid", "leave the ellipsoid open"),
    ],
    ids=["a face missing", "too few rests", "two orientations"],
)
def test_data_that_do_not_suit_a_method_are_refused_with_the_reason(made, runs, method, why):
    with pytest.raises(rivals.Unfit, match=why):
        getattr(rivals, method)(of_runs(made, runs), GRAVITY_MPS2)


def test_a_rest_is_judged_by_an_ellipsoid_of_the_others(made):
    rests = rivals.Rests.of(made.recording)
    fitted = rivals.ellipsoid(rests, GRAVITY_MPS2)
    of_all = np.linalg.norm(np.linalg.solve(fitted.D, (rests.y - fitted.b_a).T), axis=0) - GRAVITY_MPS2
    assert 1e3 * np.sqrt(np.mean(of_all**2)) < strangers.left_out(rests, GRAVITY_MPS2) < 100.0
    assert np.isnan(strangers.left_out(of_runs(made, range(6)), GRAVITY_MPS2))


@pytest.mark.parametrize(("unit", "tries"), [("", 1), (" (rad/s)", 2)])
def test_a_try_follows_the_options_of_the_refusal(unit, tries, made, tmp_path):
    names = ",".join(["time", *(f"acc_{axis}" for axis in "xyz"), *(f"gyro_{axis}{unit}" for axis in "xyz")])
    recording = made.recording
    rows = np.column_stack([recording.t, recording.acc, np.degrees(recording.gyr)])
    np.savetxt(tmp_path / "walk.csv", rows, "%.9g", ",", header=names, comments="")
    found = strangers.of_path(tmp_path / "walk.csv", gravity=GRAVITY_MPS2)
    assert found.tries == tries
    assert found.before > 10.0 * found.after
    (tmp_path / "note.txt").write_text("no table\n")
    assert strangers.of_path(tmp_path / "note.txt").tries == 0
