"""Damage to 16-bit words between a sensor and a file, and to the times and order of samples.

What befalls words takes and gives (n, 6) int32: the accelerometer's x, y, z, then the gyroscope's. What befalls times
takes the nominal times (n,) [s] of the samples, and gives the times (m,) that are written and which samples (m,) they
stand beside.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpucal.data import Vector

from .course import Rng
from .sensors import Counts

Written = tuple[Vector, NDArray[np.intp]]
Digits = Callable[[Counts, Rng], Counts]
Timing = Callable[[Vector, Rng], Written]

LOW = 0xFF
# of times that must increase
LEAST_S = 1e-5


def low_byte_zero(counts: Counts, rng: Rng) -> Counts:
    """Clear the low byte of one accelerometer axis."""
    counts[:, rng.integers(3)] &= ~LOW
    return counts


def flipped(counts: Counts, rng: Rng, per_byte: float = 1.0 / 2000.0) -> Counts:
    """Flip a bit of each byte with this probability."""
    words = counts.astype(np.int16).view(np.uint16)
    for byte in (0, 8):
        hit = rng.random(words.shape) < per_byte
        words[hit] ^= (1 << rng.integers(byte, byte + 8, int(hit.sum()))).astype(np.uint16)
    return words.view(np.int16).astype(np.int32)


def torn(counts: Counts, rng: Rng, share: float = 0.02) -> Counts:
    """Read high and low byte one after the other: with this probability the high one is of the sample before."""
    late = rng.random(counts.shape) < share
    late[0] = False
    before = np.roll(counts, 1, axis=0)
    return np.where(late, (before & ~LOW) | (counts & LOW), counts)


def signed_low(counts: Counts, rng: Rng) -> Counts:
    """Read the low byte as a signed number: where it is 128 or more, the word is 256 too small."""
    return counts - 256 * ((counts & LOW) >= 128)


def jitter(t: Vector, rng: Rng, rms_s: float = 0.002) -> Written:
    """Add to each time a Gaussian error of rms_s; they are in order."""
    return increasing(np.sort(t + rms_s * rng.standard_normal(len(t)))), np.arange(len(t))


def ticks(t: Vector, rng: Rng, tick_s: float = 0.004) -> Written:
    """Round times to whole ticks; a sample that falls into the tick of the one before is lost."""
    whole, rows = np.unique(np.floor((t + rng.uniform(0, tick_s)) / tick_s), return_index=True)
    return whole * tick_s, rows


def bursts(t: Vector, rng: Rng, count: int = 8, late_s: float = 0.004) -> Written:
    """Stamp samples as they come over a link that delivers `count` at once."""
    burst, place = np.divmod(np.arange(len(t)), count)
    arrived = t[np.minimum((burst + 1) * count, len(t)) - 1] + late_s * rng.random(burst[-1] + 1)[burst]
    return increasing(arrived + 5e-5 * place), np.arange(len(t))


def dropped(t: Vector, rng: Rng, share: float = 0.05, stretch_s: float = 0.0) -> Written:
    """Lose a share of the samples, and one stretch of stretch_s; times are right."""
    start = rng.uniform(0.3, 0.9) * t[-1]
    kept = (rng.random(len(t)) >= share) & ((t < start) | (t >= start + stretch_s))
    return t[kept], np.flatnonzero(kept)


def each_twice(t: Vector, rng: Rng) -> Written:
    """Read at twice the rate at which it measures: every sample comes twice, at evenly spaced times."""
    half = 0.5 * float(np.median(np.diff(t)))
    return np.stack((t, t + half), axis=1).ravel(), np.repeat(np.arange(len(t)), 2)


def polled(t: Vector, rng: Rng, poll_hz: float = 230.0, late_s: float = 0.0005) -> Written:
    """Read the newest sample in a loop at its own rate of poll_hz, late by up to late_s, and write its own time."""
    n = int((t[-1] - t[0]) * poll_hz)
    times = t[0] + np.arange(n) / poll_hz + late_s * rng.random(n)
    return times, np.searchsorted(t, times, side="right") - 1


def increasing(t: Vector) -> Vector:
    """Return the times, each LEAST_S after the one before it at least."""
    least = LEAST_S * np.arange(len(t))
    return np.asarray(np.maximum.accumulate(t - least) + least)
