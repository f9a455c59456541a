from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import Series, Theta
from mpucal.calibration.moves import q_scale_of_moves
from mpucal.calibration.stationary import flat_statistics
from mpucal.calibration.still import still_runs

G = 9.82


class Scene:
    """A hand's recording with the truth as theta, and where it rests."""

    def __init__(self, simulated, gyr=None):
        recording = simulated.recording
        self.flat = flat_statistics(recording, recording.flat)
        self.runs = still_runs(recording, self.flat)
        self.recording = recording if gyr is None else replace(recording, gyr=gyr)
        truth = simulated.truth
        u = simulated.specific_force[0] / G
        start = Theta.start(truth.D, truth.b_a, self.flat.b_omega, u)
        self.theta = replace(start, K=truth.K)

    def scale(self):
        series = Series.after(self.recording, self.flat)
        return q_scale_of_moves(self.recording, self.flat, series, self.theta, self.runs, G)

    def move(self, k):
        """Samples of the series between rest k and rest k + 1."""
        return slice(self.runs[k][1] - self.flat.last, self.runs[k + 1][0] - self.flat.last)


def test_moves_that_agree_keep_their_noise(hand):
    for seed in range(3):
        assert Scene(hand(seed, "pose12")).scale().max() < 2.0


@pytest.mark.parametrize("k", [3, 6])
def test_the_move_that_lost_its_gyroscope_is_the_one_that_is_doubted(in_hand, k):
    scene = Scene(in_hand)
    gyr = in_hand.recording.gyr.copy()
    first, last = scene.runs[k][1], scene.runs[k + 1][0]
    gyr[first:last] = scene.flat.b_omega
    factor = Scene(in_hand, gyr).scale()
    assert factor.shape == (len(in_hand.recording) - scene.flat.last,)
    assert factor[scene.move(k)].min() > 100.0
    for other in range(1, len(scene.runs) - 1):
        if other != k:
            middle = scene.move(other)
            assert factor[(middle.start + middle.stop) // 2] < 1e-3 * factor[scene.move(k)].min()


def test_the_doubt_is_as_large_as_the_miss(in_hand):
    """The variance of the move's angle grows to about the square of what gravity missed by."""
    scene = Scene(in_hand)
    gyr = in_hand.recording.gyr.copy()
    first, last = scene.runs[5][1], scene.runs[6][0]
    gyr[first:last] = scene.flat.b_omega
    factor = Scene(in_hand, gyr).scale()
    series = Series.after(in_hand.recording, scene.flat)
    span = scene.move(5)
    variance = np.sum(series.dt[span] ** 2 * factor[span]) * scene.flat.Sigma_omega.mean()
    before, after = (in_hand.specific_force[(a + b) // 2] for a, b in scene.runs[5:7])
    missed = np.linalg.norm(np.cross(before, after)) / G**2
    assert 0.2 * missed < np.sqrt(variance) < 5.0 * missed


def test_fewer_than_three_moves_cannot_outvote_one(in_hand):
    scene = Scene(in_hand)
    scene.runs = scene.runs[:3]
    gyr = in_hand.recording.gyr.copy()
    gyr[scene.runs[1][1] : scene.runs[2][0]] = scene.flat.b_omega
    scene.recording = replace(in_hand.recording, gyr=gyr)
    assert scene.scale() is None
