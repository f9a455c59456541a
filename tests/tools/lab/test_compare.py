import numpy as np
import pytest

from tools.lab import compare
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.table import Row


@pytest.fixture(scope="module")
def poses():
    return hand_scenario(1, "pose12", rate_hz=50.0)


def test_ours_beats_the_ellipsoid_and_that_no_calibration(poses):
    auto, ellipsoid, raw = (
        compare.grade("12 poses", method, poses.recording, poses.truth)
        for method in (compare.AUTO, "ellipsoid, turned to the gyro", compare.RAW)
    )
    assert auto.error < ellipsoid.error < raw.error


def test_a_method_that_has_no_result_says_why_and_stops_nobody(poses):
    grade = compare.grade("12 poses", "six positions", poses.recording, poses.truth)
    columns = {name: column([grade, grade]) for name, column in compare.COLUMNS.items()}
    assert columns["no result"] == 2
    assert "no rest with" in columns["why there is none"]
    assert columns["error, m/s²"] is None


def test_a_recording_that_mpucal_refuses_is_graded_by_its_reason():
    still = hand_scenario(0, "pose12", rate_hz=50.0)
    assert "few_orientations" in compare.grade("still", compare.AUTO, still.recording.part(0, 500), still.truth).why


def test_worse_than_no_calibration_is_counted():
    assert compare.COLUMNS["worse than none"]([Row(worse=np.bool_(worse)) for worse in (False, True)]) == 1
