import pytest

from tools.lab import compare
from tools.lab.scenarios.recordings import hand_scenario


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
