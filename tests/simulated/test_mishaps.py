"""Mishaps of a simulated sensor."""

import numpy as np
import pytest

from mpucal.simulated.mishaps import KNOCK_S, WARMER_C, WARMING_S, Knock, Mishap, Slip, Warmth

FORCE, RATE = np.tile([0.0, 3.0, 9.0], (5, 1)), np.zeros((5, 3))
T_S = np.array([9.0, 10.0, 10.005, 12.0, 90.0])


@pytest.mark.parametrize("kind", [Mishap, Slip, Knock, Warmth])
def test_nothing_happens_before_it_begins(kind):
    force, rate = kind().apply(FORCE, RATE, T_S)
    np.testing.assert_array_equal(force, FORCE)
    np.testing.assert_array_equal(rate, RATE)
    np.testing.assert_array_equal(kind().warmer_c(T_S), 0.0)


def begun(kind):
    mishap = kind()
    mishap.begin(10.0)
    mishap.begin(50.0)
    return mishap


def test_a_slip_turns_gravity_and_keeps_its_length():
    force, rate = begun(Slip).apply(FORCE, RATE, T_S)
    np.testing.assert_array_equal(force[:2], FORCE[:2])
    np.testing.assert_allclose(np.linalg.norm(force[3:], axis=1), np.linalg.norm(FORCE[3:], axis=1), rtol=0.02)
    cosine = force[3] @ FORCE[3] / np.linalg.norm(force[3]) / np.linalg.norm(FORCE[3])
    assert 3.0 < np.degrees(np.arccos(cosine)) < 10.0
    np.testing.assert_array_equal(rate, RATE)


def test_a_knock_is_violent_and_leaves_a_bias():
    mishap = begun(Knock)
    blow, _ = mishap.apply(FORCE[:1], RATE[:1], np.array([10.0 + KNOCK_S / 2]))
    assert np.abs(blow).max() > 80.0
    force, _ = mishap.apply(FORCE, RATE, T_S)
    np.testing.assert_allclose(force[3] - FORCE[3], force[4] - FORCE[4])
    assert 0.1 < np.linalg.norm(force[3] - FORCE[3]) < 1.0


def test_warmth_moves_biases_by_as_much_as_the_chip_says():
    mishap = begun(Warmth)
    np.testing.assert_allclose(mishap.warmer_c(np.array([10.0, 10.0 + WARMING_S, 1e3])), [0.0, WARMER_C, WARMER_C])
    _, rate = mishap.apply(FORCE, RATE, T_S)
    assert np.degrees(rate[-1]).max() == pytest.approx(1.5)
