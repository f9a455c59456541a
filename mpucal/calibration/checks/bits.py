"""Check of the bits of the readings: an axis whose low or high bits never change.

The counts are recovered where the range is known, or where all values are whole counts of one of the chip's ranges (16
bits, as the MPU-6050 and its successors have). From one sample to the next a bit may change where a higher one does: a
sound bit then changes half of the time or more, and a stuck one but for errors of the bus. The odds between the two
decide. Where the counts are not known, the steps of an axis are compared with those of the others. A sensor that is
coarse on all axes is no fault.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...data import ACCEL_COUNTS, ACCEL_RANGES_G, GYRO_COUNTS, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Mask, Vector
from ...reasons import Reason, reason
from ..evidence import Evidence
from .unusable import dead_accelerometer, dead_gyroscope

# Share of the changes in which a stuck bit changes, by errors, and least and most share of a sound one.
ERRORS, LEAST_SOUND, MOST_SOUND = 0.1, 0.4, 0.98
# Odds at which a bit is called stuck
ODDS = 1e6
# Bits may die midway: they are counted in so many pieces.
PIECES = 64
# Fewer dead low bits do not matter; so many on all axes are a byte that was not read, and no coarse sensor.
DEAD_BITS, LOST_BYTE = 3, 7
BITS = 16
# Values are whole counts, or whole steps, within this share.
EXACTLY = 0.02
# Where the counts are not known: so many steps of the other axes make a step that is odd. A smaller one [m/s^2, rad/s]
# may be that of a float32, which is coarser the larger a value is.
ODD_STEPS, LEAST_ODD_STEP = 8.0, 1e-3
# The rounding of an axis refuses a calibration beyond so many claimed uncertainties, or these limits.
HONEST_STD, MOST_MPS2, USABLE_RAD_S = 2.0, 0.1, np.deg2rad(0.5)

Words = NDArray[np.uint16]
Counts = NDArray[np.int_]


class Low(NamedTuple):
    """Low bits of an axis that never change: their number, the sample from which on, and the step that they leave."""

    axis: int
    bits: int
    first: int
    step: float


def bits_stuck(e: Evidence) -> Reason | None:
    """Find an axis of either sensor whose low or high bits never change."""
    if dead_accelerometer(e) is not None or dead_gyroscope(e) is not None:
        return None
    acc_range, gyro_range = e.recording.sensor.accel_range_g, e.recording.sensor.gyro_range_dps
    acc_lsbs = [g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS for g in ([acc_range] if acc_range else ACCEL_RANGES_G[::-1])]
    gyr_lsbs = [np.deg2rad(w / GYRO_COUNTS) for w in ([gyro_range] if gyro_range else GYRO_RANGES_DPS[-2:0:-1])]
    most = MOST_MPS2 if e.uncertainty is None else min(MOST_MPS2, HONEST_STD * e.uncertainty.rms_mps2)
    return _stuck(e, e.recording.acc, acc_lsbs, "accelerometer", "m/s^2", most) or _stuck(
        e, e.recording.gyr, gyr_lsbs, "gyroscope", "rad/s", USABLE_RAD_S
    )


def _stuck(e: Evidence, values: Vector, lsbs: Iterable[float], sensor: str, unit: str, most: float) -> Reason | None:
    for lsb in lsbs:
        if (words := _words(values, lsb)) is not None:
            stuck, first = _stuck_bits(words, e.recording.gap)
            low = _low_bits(stuck, first, lsb)
            # a single bit is told from one that lacks, among the low ones, all below it
            one = np.argwhere(stuck & ~np.logical_and.accumulate(stuck, axis=0))
            if low is None and len(one):
                bit, axis = map(int, one[-1])
                return reason("bits_stuck", "high", sensor=sensor, axis="xyz"[axis], bit=bit)
            break
    else:
        low = _odd_steps(values)
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


def _words(values: Vector, lsb: float) -> Words | None:
    """Return `values` (n, 3) as words of two's complement; None where those are not whole counts of 16 bits."""
    for part in (values[:1], values):  # the first sample most often shows another scale
        scaled = part / lsb
        counts = np.rint(scaled)
        # Rates that were not measured are NaN, and fail the comparison.
        if not (np.abs(scaled - counts).max() <= EXACTLY and np.abs(counts).max() <= ACCEL_COUNTS):
            return None
    return counts.astype(np.int64).astype(np.uint16)


def _stuck_bits(words: Words, gap: Mask) -> tuple[Mask, Counts]:
    """Return the bits that never change from some sample on (16, 3), and that sample (16, 3).

    Across a gap, as between files of single faces, nothing changes. A sound bit changes as often as on the axis where
    it does so most, and half of the time where the value jumps by more than two steps of the bit.
    """
    changed = words[1:] ^ words[:-1]
    changed[gap[1:]] = 0
    jumps = np.abs(np.diff(words.astype(np.int16).astype(int), axis=0))
    # without its sign a value that passes zero leaps from one end of the range to the other
    leaps = (np.abs(np.diff((words & 0x7FFF).astype(int), axis=0)) > 2**14) & ~gap[1:, None]
    edges = np.unique(np.linspace(0, len(changed), PIECES, endpoint=False).astype(int))
    counts = []
    for bit in range(BITS):
        may = changed >= 2 << bit if bit < BITS - 1 else leaps
        does, far = may & (changed & 1 << bit > 0), jumps >= 2 << bit
        counts.append(
            [np.add.reduceat(each, edges, dtype=int) for each in (does, may & ~does & ~far, may & ~does & far)]
        )
    does, near, far = np.moveaxis(np.array(counts), 1, 0)
    shares = (does.sum(1) + 1.0) / ((does + near + far).sum(1) + 2.0)
    sound = np.clip(shares.max(1), LEAST_SOUND, MOST_SOUND)[:, None, None]
    evidence = does * np.log(ERRORS / sound) + near * np.log((1.0 - ERRORS) / (1.0 - sound))
    evidence += far * math.log((1.0 - ERRORS) / (1.0 - LEAST_SOUND))
    # of all pieces from one on
    after = np.cumsum(evidence[:, ::-1], axis=1)[:, ::-1]
    first = edges[after.argmax(1)]
    stuck = after.max(1) > math.log(ODDS)
    # what swings by whole steps of a bit leaves it unchanged from one sample to the next, and not for long
    for bit, axis in np.argwhere(stuck):
        ones = float(np.mean(words[first[bit, axis] + 1 :, axis] >> bit & 1))
        stuck[bit, axis] = min(ones, 1.0 - ones) < ERRORS
    return stuck, first


def _low_bits(stuck: Mask, first: Counts, lsb: float) -> Low | None:
    """Return the axis with the most low bits that never change."""
    dead = np.logical_and.accumulate(stuck, axis=0).sum(0)
    axis, common = int(dead.argmax()), int(dead.min())
    bits = int(dead[axis])
    if bits < DEAD_BITS + (0 if common >= LOST_BYTE else common):
        return None
    return Low(axis, bits, int(first[:bits, axis].max()), lsb * 2.0**bits)


def _odd_steps(values: Vector) -> Low | None:
    """Return the axis that changes in multiples of a step that is many times the step of the other axes."""
    changes = np.abs(np.diff(values, axis=0))
    steps = np.min(changes, axis=0, initial=np.inf, where=changes > 0.0)
    axis, finest = int(steps.argmax()), float(np.median(steps))
    step = float(steps[axis])
    if not max(ODD_STEPS * finest, LEAST_ODD_STEP) <= step < np.inf:
        return None
    places = changes[:, axis] / step
    if np.abs(places - np.rint(places)).max() > EXACTLY:
        return None
    # Other axes may be as fine as a float, but a word has 16 bits.
    return Low(axis, min(round(math.log2(step) - math.log2(finest)), BITS - 1), 0, step)
