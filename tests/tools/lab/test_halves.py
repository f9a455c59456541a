from dataclasses import replace

import numpy as np
import pytest

from tools.lab import halves
from tools.lab.scenarios.recordings import hand_scenario


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
    # its last orientation is its first one
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
