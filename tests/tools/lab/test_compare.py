import numpy as np
import pytest

from tools.lab import compare
from tools.lab.scenarios.recordings import GRAVITY_MPS2, hand_scenario


@pytest.fixture(scope="module")
def poses():
    return hand_scenario(1, "pose12", rate_hz=50.0)


def test_ours_beats_the_ellipsoid_and_that_no_calibration(poses):
    auto, ellipsoid, raw = (
        compare.grade("12 poses", method, poses.recording, GRAVITY_MPS2, poses.truth)
        for method in (compare.AUTO, "ellipsoid, turned to the gyro", compare.RAW)
    )
    assert auto.error < ellipsoid.error < raw.error
    assert auto.rest_rms < raw.rest_rms
    assert auto.miss_median < raw.miss_median


def test_a_method_that_has_no_result_says_why_and_stops_nobody(poses):
    grade = compare.grade("12 poses", "six positions", poses.recording, GRAVITY_MPS2, poses.truth)
    assert "no rest with" in grade.why
    assert np.isnan(grade.error)
    columns = {name: column([grade, grade]) for name, column in compare.SIMULATED.items()}
    assert columns["no result"] == 2
    assert "no rest with" in columns["why there is none"]


def test_a_recording_that_mpucal_refuses_is_graded_by_its_reason():
    still = hand_scenario(0, "pose12", rate_hz=50.0).recording.part(0, 500)
    assert "few_orientations" in compare.grade("still", compare.AUTO, still, GRAVITY_MPS2).why


def test_a_real_recording_shows_magnitudes_beside_the_papers():
    row = [compare.Grade("desk", compare.AUTO, median=9.81, mean=9.82, std=0.2, note="hand, good")]
    assert [compare.RECORDED[name](row) for name in ("|a|: median", "sd", "note")] == ["9.810", "0.200", "hand, good"]
    assert [compare.RECORDED["sd"]([grade]) for grade in compare.PAPER_4_1] == ["0.230", "0.300"]


def test_worse_than_no_calibration_is_counted():
    grades = [compare.Grade("continuous", "six", error=error, before=0.8) for error in (0.7, 0.9)]
    assert compare.SIMULATED["worse than none"](grades) == 1
