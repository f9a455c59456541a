from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.errors import RecordingError
from tools.lab import halves
from tools.lab.judge import judged
from tools.lab.scenarios.recordings import GRAVITY_MPS2, hand_scenario, paper_scenario


@pytest.fixture(scope="module")
def poses():
    return hand_scenario(1, "pose12", rate_hz=50.0)


def test_the_cut_is_in_a_rest_near_the_middle(poses):
    one, other = halves.halves(poses.recording)
    assert len(one) + len(other) == len(poses.recording)
    np.testing.assert_array_equal(np.concatenate([one.acc, other.acc]), poses.recording.acc)
    assert 20.0 < other.t[0] < 40.0
    assert one.flat == poses.recording.flat
    first, last = other.flat
    assert first == 0
    assert last > 0.5 * other.rate_hz
    assert other.gyr[first:last].std(0).max() < 0.05


def test_without_a_rest_in_the_middle_the_second_half_is_read_backwards():
    recording = hand_scenario(0, "continuous", rate_hz=50.0).recording
    # it ends as it began
    there_and_back = halves.reversed_in_time(recording)
    n, bias = len(recording), recording.gyr[:500].mean(0)
    whole = replace(
        recording,
        t=np.arange(2 * n) / 50.0,
        acc=np.concatenate([recording.acc, there_and_back.acc]),
        gyr=np.concatenate([recording.gyr, there_and_back.gyr + 2.0 * bias]),
        **{name: np.zeros(2 * n, bool) for name in ("gap", "acc_clipped", "gyr_clipped")},
        temperature_c=np.full(2 * n, np.nan),
    )
    one, other = halves.halves(whole)
    assert other.flat[0] < 25
    assert one.gyr[: one.flat[1]].std(0).max() < 0.05
    np.testing.assert_allclose(other.acc[: 8 * 50], whole.acc[::-1][: 8 * 50])


def test_a_recording_that_ends_in_motion_has_no_halves():
    with pytest.raises(RecordingError, match="ends at rest"):
        halves.halves(hand_scenario(0, "continuous", rate_hz=50.0).recording)


def test_a_rest_alone_has_no_halves():
    recording = hand_scenario(0, "pose12", rate_hz=50.0).recording
    with pytest.raises(RecordingError, match="no second rest"):
        halves.halves(replace(recording.part(0, recording.flat[1]), flat=None))


def test_backwards_the_same_sensor_is_found():
    simulated = paper_scenario(0, rate_hz=50.0)
    recording = simulated.recording
    # so that it rests at both ends
    longer = replace(
        recording,
        t=np.arange(len(recording) + 500) / 50.0,
        acc=np.concatenate([recording.acc, recording.acc[:500]]),
        gyr=np.concatenate([recording.gyr, recording.gyr[:500]]),
        **{name: np.zeros(len(recording) + 500, bool) for name in ("gap", "acc_clipped", "gyr_clipped")},
        temperature_c=np.full(len(recording) + 500, np.nan),
    )
    backwards = replace(halves.reversed_in_time(longer), flat=(0, 500))
    result = mpucal.calibrate(backwards, gravity=GRAVITY_MPS2)
    assert result.fit["model"] == "accel"
    np.testing.assert_allclose(result.b_omega, -simulated.truth.b_omega, atol=0.02)
    assert judged(result, (simulated.truth.D, simulated.truth.b_a)).rms_z < 2.0


def test_a_gap_stands_on_its_other_side_backwards(poses):
    gap = np.zeros(len(poses.recording), bool)
    gap[100] = True  # between 99 and 100
    backwards = halves.reversed_in_time(replace(poses.recording, gap=gap))
    n = len(gap)
    assert np.flatnonzero(backwards.gap).tolist() == [n - 1 - 99]


def test_z_is_the_rms_in_units_of_the_claim():
    one, other = (
        mpucal.Calibration(D, np.zeros(3), np.full((3, 3), 0.3), np.full(3, 0.3), fit={"model": model})
        for D, model in ((np.eye(3), "hand"), (np.eye(3) + np.triu(np.full((3, 3), 0.5)), "imu"))
    )
    agreement = halves.agreement("desk", one, replace(other, D_std=np.full((3, 3), 0.4), b_a_std=np.full(3, 0.4)))
    assert agreement.model == "hand/imu"
    assert halves.COLUMNS["rms z, worst"]([agreement]) == pytest.approx(np.sqrt(0.5))
    assert halves.COLUMNS["largest |z|"]([agreement]) == pytest.approx(1.0)
