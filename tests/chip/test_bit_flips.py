"""Repair of flipped bits, and motions that are left alone."""

import numpy as np
import pytest

from mpucal.chip.bit_flips import BitFlipFilter

NONE = np.zeros((0, 7), np.int16)


def stream(rng, n=400):
    """Frames of a board that is turned and shaken, with noise."""
    t = np.arange(n) / 200
    slow = np.sin(2 * np.pi * np.outer(t, rng.uniform(0.1, 1.5, 7))) * rng.uniform(500, 6000, 7)
    return np.rint(slow + rng.normal(0, 20, (n, 7))).astype(np.int16)


def filtered(frames, length):
    """Pass the frames in polls of `length`: (frames, number repaired). A frame that is passed is never changed."""
    flips, passed, waiting = BitFlipFilter(7), [], NONE
    for first in range(0, len(frames), length):
        repaired = flips.repair(frames[first : first + length].copy(), waiting)
        run = np.concatenate((waiting, repaired))
        ready = len(run) - flips.is_open
        passed, waiting = [*passed, run[:ready]], run[ready:]
    return np.concatenate((*passed, waiting)), flips.repaired


@pytest.mark.parametrize(("length", "bit"), [(1, 11), (2, 15), (8, 13)])
def test_a_flipped_bit_is_repaired(bit, length):
    rng = np.random.default_rng(bit)
    true = stream(rng)
    spoilt = true.copy()
    places = [(at, int(rng.integers(7))) for at in range(103, 390, 13)]
    for at, word in places:
        spoilt[at, word] = (spoilt[at, word].astype(np.uint16) ^ np.uint16(1 << bit)).astype(np.int16)
    passed, repaired = filtered(spoilt, length)
    assert repaired >= 0.9 * len(places)
    assert (passed != true).sum() == len(places) - repaired


def test_motion_a_step_and_a_blow_are_left_alone():
    true = stream(np.random.default_rng(1), 4000)
    true[2000:] += 4096
    true[3000, :3] += 4096
    passed, repaired = filtered(true, 8)
    assert repaired == 0
    assert np.array_equal(passed, true)
