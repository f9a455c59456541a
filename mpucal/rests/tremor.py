"""Tremor and sway of a hand at rest: a low pass removes the tremor of a rest, and the law of the sway is equation (13).

A hand that holds still trembles at 8 to 12 Hz and sways below 1 Hz. The mean of a rest's readings keeps what the tremor
did at its two ends. The low pass weighs the ends less and removes it; what is left is the acceleration of a position
that three poles at SWAY_PER_S keep bounded (docs/method.md), with a size of its own in each rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from .flat import Flat
from .intervals import Intervals, statistics

LOW_PASS_S = 0.2  # length of a Hann window, whose response is zero at 10 Hz and nearly 1 below 1 Hz
SHORTEST = 3  # windows that a rest lasts at least to be low-passed
SWAY_PER_S, TREMOR_PER_S = 5.0, 20.0  # lambda of what the low pass leaves, and of a whole tremor
TREMBLES = 0.04  # a tremor's variance below this share of the sensor's noise counts as zero


class RestingHand(NamedTuple):
    """A hand's acceleration in k rests.

    acc : (n, 3) m/s^2, the readings, without the tremor of the rests that are long enough.
    sway : (k,) (m/s^2)^2, variance of the hand's acceleration in these; 0 of a still board.
    jitter : (k,) (m/s^2)^2, variance that the tremor of each of the other rests leaves in its mean.
    """

    acc: Vector
    sway: Vector
    jitter: Vector


def without_tremor(recording: Recording, flat: Flat, runs: Intervals, noise_factor: Vector) -> RestingHand:
    """Remove the tremor of rests by a low pass.

    Parameters
    ----------
    runs : (k, 2) rests. noise_factor : (k,) noise of the accelerometer in each, as a factor of Sigma_a.
    """
    acc, noise = recording.acc.copy(), noise_factor[:, None] * flat.Sigma_a
    window = _window(recording.rate_hz)
    n = len(window)
    tremor = tremor_variance(statistics(acc, runs)[1], noise)
    samples = np.asarray(runs[:, 1] - runs[:, 0], np.float64)
    # A rest that continues the flat segment is not in a hand, and of a short rest the low pass would leave nothing. A
    # table that hums is low-passed, too: a skewed wave would move the robust mean of a rest.
    is_held, is_long = runs[:, 0] > flat.last, samples >= SHORTEST * n
    passed = is_held & is_long
    if passed.any():
        # One convolution for all rests, each with the samples beside it: calls for each rest take longer.
        half, ends = n // 2, runs[passed].tolist()
        beside = np.concatenate([np.arange(first - half, last + half) for first, last in ends])
        low = _convolved(recording.acc[np.clip(beside, 0, len(acc) - 1)], window)
        begin = 0
        for first, last in ends:
            acc[first:last] = low[begin : begin + last - first]
            begin += last - first + 2 * half
        noise[passed] *= window @ window
    sway = tremor_variance(statistics(level_rests(acc, recording, flat, runs), runs)[1], noise)
    is_raw = is_held & (tremor > 0.0) & ~is_long
    jitter = sway * mean_variance(TREMOR_PER_S * samples / recording.rate_hz)
    return RestingHand(acc, np.where(is_raw, 0.0, sway), np.where(is_raw, jitter, 0.0))


def low_pass(values: Vector, rate_hz: float) -> Vector:
    """Return the part of values (n, 3) below the frequencies of a tremor."""
    window = _window(rate_hz)
    return _convolved(np.pad(values, ((len(window) // 2,), (0,)), "edge"), window)


def _convolved(values: Vector, window: Vector) -> Vector:
    return np.stack([np.convolve(axis, window, "valid") for axis in values.T], axis=1)


def _window(rate_hz: float) -> Vector:
    """Return the Hann window of the low pass, of an odd length."""
    window = np.hanning((round(LOW_PASS_S * rate_hz) | 1) + 2)[1:-1]
    return np.asarray(window / window.sum())


def tremor_variance(variance: Vector, noise: Vector) -> Vector:
    """Return the tremor's variance (k,) [(m/s^2)^2] in k rests, beyond noise (k, 3); 0 of a still board.

    variance : (k, 3) (m/s^2)^2, of the readings.
    """
    tremor = np.mean(variance - 1.05 * noise, axis=-1)
    return np.where(tremor > TREMBLES * noise.mean(axis=-1), tremor, 0.0)


def mean_variance(x: Vector) -> Vector:
    """Return the variance of a mean over T as a share of the acceleration's; x = lambda T.

    The acceleration's autocovariance at a lag of t is exp(-u) (1 - 5 u / 3 + u^2 / 3) of its variance, u = lambda t.
    """
    return np.asarray(2.0 / (3.0 * x * x) * (1.0 - (1.0 + x - x * x) * np.exp(-x)))


def level_rests(acc: Vector, recording: Recording, flat: Flat, runs: Intervals) -> Vector:
    """Return `acc` (n, 3) [m/s^2], in each run rotated by the gyroscope into the axes of the run's middle.

    Otherwise a slow turn of the hand, which moves gravity through the axes, would pass for an acceleration of the hand.
    """
    acc = acc.copy()
    steps = np.diff(recording.t, prepend=recording.t[0])[:, None] * (recording.gyr - flat.b_omega)
    path = np.cumsum(steps, axis=0)
    # All runs are rotated at once, since there are many.
    lengths = runs[:, 1] - runs[:, 0]
    begins = np.cumsum(lengths) - lengths
    at = np.arange(lengths.sum()) + np.repeat(runs[:, 0] - begins, lengths)
    phi = path[at] - path[np.repeat((runs[:, 0] + runs[:, 1]) // 2, lengths)]
    once = np.cross(phi, acc[at])
    acc[at] += once + 0.5 * np.cross(phi, once)
    return acc
