"""Words of the readings: the counts that a logger made of the chip's bytes, and a low byte that it took for signed.

The counts are recovered where the range is known, or where all values are whole counts of one of the chip's ranges (16
bits, as the MPU-6050 and its successors have), or of the smallest step between them.

A logger that takes the low byte for a signed number makes a word 256 too low wherever bit 7 is set. Nothing is lost by
it: the low byte is the true one. Whether it did so shows wherever bit 7 changes from one sample to the next: either the
words as they are, or the corrected ones, leap there by 256. Steps of a sensor are distributed as by Laplace, with the
scale that they have where bit 7 does not change, and the odds are those of all steps together.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, compress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data import (
    ACCEL_COUNTS,
    ACCEL_RANGES_G,
    GYRO_COUNTS,
    GYRO_RANGES_DPS,
    Mask,
    Recording,
    Vector,
    mps2_per_count,
)

# Values are whole counts within this share.
EXACTLY = 0.02
# Odds at which a fault of the bits is believed.
ODDS = 1e6
SIGN = 0x80

Counts = NDArray[np.int32]


class Words(NamedTuple):
    """Words of a sensor: counts (n, 3), and the value of a count."""

    counts: Counts
    lsb: float

    @property
    def steps(self) -> Counts:
        """Steps (n - 1, 3) from one sample to the next, in counts."""
        return np.abs(np.diff(self.counts, axis=0))

    @property
    def finest(self) -> int:
        """Smallest step that is not 0, in counts; the largest reading of words that never change."""
        steps = self.steps
        return int(steps[steps > 0].min(initial=np.abs(self.counts).max()))


class Decoded(NamedTuple):
    """Recording of true words.

    words : those of the accelerometer and of the gyroscope; None where they are not known.
    corrected : axes of which a low byte had been taken for signed.
    """

    recording: Recording
    words: tuple[Words | None, Words | None]
    corrected: str = ""

    def part(self, first: int, last: int) -> Decoded:
        """Return the samples first..last-1."""
        acc, gyr = (each and each._replace(counts=each.counts[first:last]) for each in self.words)
        return Decoded(self.recording.part(first, last), (acc, gyr), self.corrected)


def _words_of(recording: Recording) -> tuple[Words | None, Words | None]:
    """Return the words of the accelerometer and of the gyroscope; None where they are not known."""
    acc_range, gyro_range = recording.sensor.accel_range_g, recording.sensor.gyro_range_dps
    # A coarse count is no whole number of finer ones.
    acc_lsbs = [mps2_per_count(g) for g in ([acc_range] if acc_range else ACCEL_RANGES_G[::-1])]
    gyro_ranges = [gyro_range] if gyro_range else GYRO_RANGES_DPS[-2:0:-1]
    # programs of others divide the range by 2^15 counts
    gyr_lsbs = [np.deg2rad(each / most) for each in gyro_ranges for most in (GYRO_COUNTS, ACCEL_COUNTS)]
    return _words(recording.acc, acc_lsbs), _words(recording.gyr, gyr_lsbs)


def _words(values: Vector, lsbs: Iterable[float]) -> Words | None:
    return next(
        (Words(counts, lsb) for lsb in chain(lsbs, _finest(values)) if (counts := _counts(values, lsb)) is not None),
        None,
    )


def _finest(values: Vector) -> Iterator[float]:
    """Yield the smallest step between two samples, if there is one; a scale that is known needs none."""
    steps = np.abs(np.diff(values, axis=0))
    finest = float(np.min(steps, where=steps > 0.0, initial=np.inf))
    if np.finfo(np.float64).tiny < finest < np.inf:
        yield finest


def _counts(values: Vector, lsb: float) -> Counts | None:
    """Return `values` (n, 3) in counts; None where those are not whole counts of 16 bits."""
    for part in (values[:1], values):  # the first sample most often shows another scale
        scaled = part / lsb
        counts = np.rint(scaled)
        # Rates that were not measured are NaN, and fail the comparison.
        if not (np.abs(scaled - counts).max() <= EXACTLY and np.abs(counts).max() <= ACCEL_COUNTS):
            return None
    return counts.astype(np.int32)


def _coarse_step(words: Words | None) -> float:
    """Return the step of readings of which most are the same as the one before, or a step from it; 0 of finer ones."""
    if words is None:
        return 0.0
    finest = words.finest
    return finest * words.lsb if 2 * np.count_nonzero(words.steps <= finest) > words.steps.size else 0.0


def decode(recording: Recording) -> Decoded:
    """Recover the words of a recording, and correct those whose low byte was taken for signed."""
    words = _words_of(recording)
    (acc_step, gyr_step), (of_acc, of_gyr) = recording.sensor.steps, words
    steps = acc_step or _coarse_step(of_acc), gyr_step or _coarse_step(of_gyr)
    recording = replace(recording, sensor=replace(recording.sensor, steps=steps))
    odds = np.array([np.zeros(3) if each is None else _log_odds(each.counts, recording.gap) for each in words])
    sure = math.log(ODDS)
    # One program reads all words: an axis that shows nothing is taken to be as the others.
    wrong = (odds > sure) | ((odds > -sure) & (odds.sum() > sure))
    if not wrong.any():
        return Decoded(recording, words)
    acc, gyr = (
        None if each is None else each._replace(counts=np.where(at, _corrected(each.counts), each.counts))
        for each, at in zip(words, wrong, strict=True)
    )
    corrected = replace(
        recording,
        acc=recording.acc if acc is None else np.where(wrong[0], acc.lsb * acc.counts, recording.acc),
        gyr=recording.gyr if gyr is None else np.where(wrong[1], gyr.lsb * gyr.counts, recording.gyr),
    )
    names = [
        f"the {sensor}'s {', '.join(compress('xyz', at))}"
        for sensor, each, at in zip(("accelerometer", "gyroscope"), words, wrong, strict=True)
        if each is not None and at.any()
    ]
    return Decoded(corrected, (acc, gyr), " and ".join(names))


def _corrected(counts: Counts) -> Counts:
    return np.asarray(counts + 2 * (counts & SIGN))


def _log_odds(counts: Counts, gap: Mask) -> Vector:
    """Return (3,) the log odds of a low byte that was taken for signed, by axis."""
    is_step = (~gap[1:]).astype(np.float64)
    steps, corrected = (np.abs(np.diff(each, axis=0)) for each in (counts, _corrected(counts)))
    same = steps == corrected
    scale = is_step @ (steps * same) / np.maximum(is_step @ same, 1.0)
    return np.asarray(is_step @ (steps - corrected) / np.maximum(scale, 1.0))
