import io

import numpy as np
import pytest
from rich.console import Console

from tools.lab import compare
from tools.lab.study.scenarios import GRAVITY_MPS2, hand_scenario


@pytest.fixture(scope="module")
def poses():
    return hand_scenario(1, "pose12", rate_hz=50.0)


def printed(table):
    stream = io.StringIO()
    Console(file=stream, width=200).print(table)
    return stream.getvalue()


def test_ours_beats_the_ellipsoid_and_that_no_calibration(poses):
    auto, ellipsoid, raw = (
        compare.grade(method, poses.recording, GRAVITY_MPS2, poses.truth)
        for method in (compare.AUTO, "ellipsoid, turned to the gyro", compare.RAW)
    )
    assert auto.sph_rms < ellipsoid.sph_rms < raw.sph_rms
    assert auto.rest_rms < raw.rest_rms
    assert auto.miss_median < raw.miss_median


def test_a_method_that_has_no_result_says_why_and_stops_nobody(poses):
    grade = compare.grade("six positions", poses.recording, GRAVITY_MPS2, poses.truth)
    assert "no rest with" in grade.why
    assert np.isnan(grade.sph_rms)
    runs = [[compare.Grade(compare.RAW, sph_rms=0.8), grade]] * 2
    row = next(line for line in printed(compare.simulated_table("", runs)).splitlines() if "six" in line)
    assert "no rest with" in row


def test_a_recording_that_mpucal_refuses_is_graded_by_its_reason():
    still = hand_scenario(0, "pose12", rate_hz=50.0).recording.part(0, 500)
    assert "few_orientations" in compare.grade(compare.AUTO, still, GRAVITY_MPS2, None).why


def test_magnitudes_stand_before_and_after_and_beside_the_papers():
    grades = [
        compare.Grade(compare.RAW, median=9.5, mean=9.6, std=0.4),
        compare.Grade(compare.AUTO, median=9.81, mean=9.82, std=0.2),
    ]
    text = printed(compare.magnitudes_table({"desk": grades}, 9.81))
    assert "9.500 -> 9.810" in text
    assert "-> 0.23" in text
