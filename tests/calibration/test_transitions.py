from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.parameters import NAMES
from mpucal.calibration.preprocessing import preprocess
from mpucal.calibration.theta import Theta
from mpucal.calibration.transitions import Transition, leverages, miss_variances, q_scale, transitions_of

G = 9.82


class Moved:
    """A hand's recording with the truth as theta, and where it rests."""

    def __init__(self, simulated, gyr=None):
        recording = simulated.recording if gyr is None else replace(simulated.recording, gyr=gyr)
        self.prepared = preprocess(recording, recording.flat, G)
        self.flat, self.runs = self.prepared.flat, self.prepared.runs
        truth = simulated.truth
        u = simulated.specific_force[0] / G
        start = Theta.start(truth.D, truth.b_a, self.flat.b_omega, u)
        self.theta = replace(start, K=truth.K)

    def scale(self):
        """(n,) the factor of the gyroscope's noise."""
        moves = transitions_of(self.prepared, self.theta)
        return q_scale(moves, miss_variances(moves), len(self.prepared.problem.series))

    def move(self, k):
        """Samples of the series between rest k and rest k + 1."""
        return slice(self.runs[k][1] - self.flat.last, self.runs[k + 1][0] - self.flat.last)


def test_the_move_that_lost_its_gyroscope_is_the_one_that_is_doubted(in_hand):
    k, prepared = 6, Moved(in_hand)
    gyr = in_hand.recording.gyr.copy()
    first, last = prepared.runs[k][1], prepared.runs[k + 1][0]
    gyr[first:last] = prepared.flat.b_omega
    factor = Moved(in_hand, gyr).scale()
    assert factor.shape == (len(in_hand.recording) - prepared.flat.last,)
    # Without a gyroscope the rests that are found reach a little into the move.
    in_the_middle = [
        factor[(move.start + move.stop) // 2] for move in map(prepared.move, range(len(prepared.runs) - 1))
    ]
    doubted = in_the_middle.pop(k)
    assert doubted > 100.0
    assert max(in_the_middle) < 1e-3 * doubted


def test_a_miss_depends_on_the_parameters_as_its_jacobian_says(in_hand):
    """Compare the trace of J C J', for a C of one parameter, with central differences of the miss."""
    moved = Moved(in_hand)
    prepared, theta = moved.prepared, moved.theta
    moves = transitions_of(prepared, theta)
    ones = np.ones(len(moves))
    for p, name in enumerate(NAMES):
        if not name.startswith(("D_", "b_a_", "K_")):
            continue
        h = 1e-4
        C = np.zeros((len(NAMES), len(NAMES)))
        C[p, p] = 1e-4  # so small that no leverage reaches its limit of two
        ahead, behind = (
            np.array([move.miss for move in transitions_of(prepared, theta.moved(step * np.eye(len(NAMES))[p]))])
            for step in (h, -h)
        )
        wanted = 1e-4 * np.sum(((ahead - behind) / (2 * h)) ** 2, axis=1)
        given = leverages(moves, prepared, theta, C, ones)
        assert given == pytest.approx(wanted, rel=0.03, abs=1e-6), name


def test_misses_that_an_estimate_took_up_leave_more_noise():
    """Draw misses of twice the variance by noise, for an estimate that took half of them."""
    rng = np.random.default_rng(0)
    still = np.eye(3)
    moves = [
        Transition(
            slice(0, 1), still, np.eye(3)[2], np.eye(3)[2], np.append(rng.normal(0.0, np.sqrt(2.0), 2), 0.0), 1.0, 1.0
        )
        for _ in range(400)
    ]
    # Student's t gives the tail less weight.
    blind = miss_variances(moves).mean()
    assert blind == pytest.approx(2.0, rel=0.35)
    assert miss_variances(moves, np.ones(400)).mean() > 1.8 * blind
    assert miss_variances(moves, 1.0) == pytest.approx(miss_variances(moves, np.ones(400)))
