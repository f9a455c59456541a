"""Words that jump alone, and are back with the next sample: no board moves like that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Recording

# A word that jumps alone: by so much [m/s^2, rad/s] at least, by so many times what its neighbours depart from theirs,
# and they differ by so little of it.
LEAST_JUMP, JUMPS, RETURNS = np.repeat((0.3, 0.15), 3), 8.0, 0.25
# the samples on either side that say whether one of its words does
BESIDE = 4


def remove_spikes(recording: Recording) -> Recording:
    """The recording with the mean of its neighbours for a word that jumps alone and is back with the next sample.

    Bits that a transfer flipped (chip/bit_flips.py sets the last frame of a poll right with the next poll only), and
    what else spoils a word in a file.
    """
    words = np.hstack((recording.acc, recording.gyr))
    before, after = words[:-2], words[2:]
    mean = 0.5 * (before + after)
    off = np.pad(np.abs(words[1:-1] - mean), ((3, 3), (0, 0)))
    # the departures of the samples beside it hold half of the jump: those beyond them do not
    usual = np.max([off[k : len(off) - 6 + k] for k in (0, 1, 5, 6)], axis=0)
    off = off[3:-3]
    jumps = off > np.maximum(LEAST_JUMP, JUMPS * usual)
    alone = jumps & (np.abs(after - before) < RETURNS * off) & (jumps.sum(axis=1, keepdims=True) == 1)
    if not alone.any():
        return recording
    words[1:-1][alone] = mean[alone]
    acc, gyr = np.hsplit(words, 2)
    return replace(recording, acc=acc, gyr=gyr)
