"""Parts of a series: their scores sum to the whole's."""

import numpy as np
import pytest

from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.likelihood import evaluate, part_scores
from mpucal.calibration.parameters import ACCEL, HAND
from mpucal.calibration.preprocessing import preprocess
from mpucal.calibration.problem import Problem, Series
from mpucal.rests.flat import find_flat, flat_statistics
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82


def in_hand(hand):
    recording = hand(1, "continuous").recording
    prepared = preprocess(recording, find_flat(recording), G)
    return prepared.white(0.3), initialise(prepared.problem, prepared.flat.b_omega)


def in_place(_):
    recording = paper_scenario(1, rate_hz=50).recording
    flat = flat_statistics(recording, find_flat(recording))
    problem = Problem(Series.after(recording, flat), flat, G)
    return problem, initialise(problem, flat.b_omega)


@pytest.mark.parametrize(("made", "parameters", "block"), [(in_place, ACCEL, 8), (in_hand, HAND, 16)])
def test_the_parts_scores_sum_to_the_whole(hand, made, parameters, block):
    problem, theta = made(hand)
    n = len(problem.series)
    cut = evaluate(problem, theta, parameters, np.array([n // 3, n // 2, n]))
    scores = part_scores(problem, theta, parameters, cut.to_ends)
    begin, whole = evaluate(problem.first(0), theta, parameters), evaluate(problem, theta, parameters)
    np.testing.assert_allclose(scores.gradient.sum(0) + begin.gradient, whole.gradient, rtol=1e-9)
    np.testing.assert_allclose(scores.fisher.sum(0) + scores.flat.fisher, whole.fisher, rtol=1e-9, atol=1e-6)
    # The kernel sums up to whole blocks of steps, of which the flat mean is the first.
    end = (n // 3 // block + 1) * block - 1
    first = evaluate(problem.first(end), theta, parameters)
    np.testing.assert_allclose(scores.gradient[0] + begin.gradient, first.gradient, rtol=1e-9)
