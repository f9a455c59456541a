"""Check of the bits of the readings: an axis whose low or high bits never change.

From one sample to the next a bit may change where a higher one does: a sound bit then changes as often as the size of
the step says, always in a small one, and a stuck bit but for errors of the bus. The odds between the two decide. A
sensor that is coarse on all axes is no fault.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...data import Mask
from ...kernel import _kernel
from ...reasons import Reason, reason
from ..evidence import Evidence
from ..scores import MOST_PARTS
from ..words import ODDS, Counts, Words
from .estimate import GOOD_RMS_MPS2
from .unusable import dead_accelerometer, dead_gyroscope

# Share of the changes in which a stuck bit changes, by errors, and most share of a sound one.
ERRORS, SOUND = 0.1, 0.98
# Fewer dead low bits do not matter; so many on all axes are a byte that was not read, and no coarse sensor.
DEAD_BITS, LOST_BYTE = 3, 7
# Rounding of the rates by more refuses a calibration.
MOST_RAD_S = np.deg2rad(0.5)


class Low(NamedTuple):
    """Low bits of an axis that never change: their number, the sample from which on, and the step that they leave."""

    axis: int
    bits: int
    first: int
    step: float


def bits_stuck(e: Evidence) -> Reason | None:
    """Find an axis of either sensor whose low or high bits never change."""
    if e.flat is not None and (dead_accelerometer(e) or dead_gyroscope(e)) is not None:
        return None
    acc, gyr = (None, None) if e.decoded is None else e.decoded.words
    # Rounding by half a step must stay within two standard deviations of what is claimed, or of a good calibration.
    most = 2.0 * min(GOOD_RMS_MPS2, np.inf if e.uncertainty is None else e.uncertainty.rms_mps2)
    return _stuck(e, acc, "accelerometer", "m/s^2", most) or _stuck(e, gyr, "gyroscope", "rad/s", MOST_RAD_S)


def _stuck(e: Evidence, words: Words | None, sensor: str, unit: str, most: float) -> Reason | None:
    if words is None:
        return None
    stuck, first = _stuck_bits(words.counts, e.recording.gap)
    low = _low_bits(stuck, first, words.lsb)
    # a single bit differs from one that lacks, among the low ones, all below it
    one = np.argwhere(stuck & ~np.logical_and.accumulate(stuck, axis=0))
    if low is None and len(one):
        bit, axis = map(int, one[-1])
        return reason("bits_stuck", "high", sensor=sensor, axis="xyz"[axis], bit=bit)
    if low is None:
        return None
    seconds = float(e.recording.t[low.first] - e.recording.t[0])
    return reason(
        "bits_stuck",
        "low",
        0.5 * low.step > most,
        sensor=sensor,
        axis="xyz"[low.axis],
        bits=low.bits,
        when=f" from {seconds:.0f} s on" if low.first else "",
        step=low.step,
        unit=unit,
    )


def low_byte_signed(e: Evidence) -> Reason | None:
    """Find words whose low byte was taken for signed; they were corrected before anything else."""
    axes = "" if e.decoded is None else e.decoded.corrected
    return reason("low_byte_signed", "corrected", axes=axes) if axes else None


def _stuck_bits(counts: Counts, gap: Mask) -> tuple[Mask, Counts]:
    """Return the bits that never change from some sample on (16, 3), and that sample (16, 3).

    Across a gap, as between files of single faces, nothing changes.
    """
    few = 0.5 * ERRORS  # share of the samples in which a stuck bit is another one: an error changes it twice
    # Bits may die midway: they are counted in parts. For a second or two, a swing may leave a bit unchanged.
    edges = np.unique(np.linspace(0, (1.0 - few) * len(counts), MOST_PARTS, endpoint=False).astype(np.int64))
    evidence = _kernel.stuck_odds(counts, gap, edges, ERRORS, SOUND)
    # of all parts from one on
    after = np.cumsum(evidence[:, ::-1], axis=1)[:, ::-1]
    first, stuck = edges[after.argmax(1)], after.max(1) > math.log(ODDS)
    # What swings by whole steps of a bit leaves it unchanged from one sample to the next, and not for long.
    for bit, axis in np.argwhere(stuck):
        ones = float(np.mean(counts[first[bit, axis] + 1 :, axis] >> bit & 1))
        stuck[bit, axis] = min(ones, 1.0 - ones) < few
    return stuck, first


def _low_bits(stuck: Mask, first: Counts, lsb: float) -> Low | None:
    """Return the axis with the most low bits that never change."""
    dead = np.logical_and.accumulate(stuck, axis=0).sum(0)
    axis, common = int(dead.argmax()), int(dead.min())
    bits = int(dead[axis])
    if bits < DEAD_BITS + (0 if common >= LOST_BYTE else common):
        return None
    return Low(axis, bits, int(first[:bits, axis].max()), lsb * 2.0**bits)
