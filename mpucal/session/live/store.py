"""The samples of a session so far, averaged to at most 200 Hz for the live fits."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from ...data import Mask, Recording, Samples, Sensor, Vector

# Means of what comes faster: a hand does nothing that is not seen at this rate.
MOST_HZ = 200.0
# A word that jumps alone: by so much [m/s^2, rad/s] at least, by so many times what its neighbours depart from theirs,
# and they differ by so little of it.
LEAST_JUMP, JUMPS, RETURNS = np.repeat((0.3, 0.15), 3), 8.0, 0.25


class SampleStore:
    """Grows by samples as they arrive; the times are those known then.

    Parameters
    ----------
    sensor : whose rate is known.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        rate_hz = sensor.rate_hz or MOST_HZ
        self._size = max(int(rate_hz / MOST_HZ * (1.0 + 1e-6)), 1)
        self._done = Samples.empty()
        self._parts: list[Samples] = []
        self._rest = Samples.empty()
        self._torn = False

    def add(self, samples: Samples) -> None:
        """They came after all others."""
        if self._torn and len(samples):
            samples = replace(samples, gap=np.append(True, samples.gap[1:]))
            self._torn = False
        if self._size > 1:
            pending = Samples.joined([self._rest, samples])
            used = len(pending) // self._size * self._size
            samples, self._rest = _means(_cut(pending, 0, used), self._size), _cut(pending, used, len(pending))
        if len(samples):
            self._parts.append(samples)

    def forget(self, first: int) -> None:
        """Keep those of the first so many that were added, and mark a gap before what follows."""
        self._join()
        self._done, self._rest, self._torn = _cut(self._done, 0, first // self._size), Samples.empty(), True

    def recording(self) -> Recording:
        """All of them, without the flips that the decoder saw too late."""
        self._join()
        acc, gyr = np.hsplit(_without_flips(np.hstack([self._done.acc, self._done.gyr])), 2)
        return Recording(**{**vars(self._done), "acc": acc, "gyr": gyr}, sensor=self._sensor)

    def _join(self) -> None:
        if self._parts:
            self._done, self._parts = Samples.joined([self._done, *self._parts]), []


def _cut(samples: Samples, first: int, last: int) -> Samples:
    return Samples(*(getattr(samples, f.name)[first:last] for f in fields(Samples)))


def _without_flips(words: Vector) -> Vector:
    """(n, 6) with the mean of its neighbours for a word that jumps alone and is back with the next sample.

    A bit flipped in the last frame of a poll is set right with the next poll only (chip/flips.py), when the samples
    are here already.
    """
    before, after = words[:-2], words[2:]
    mean = 0.5 * (before + after)
    off = np.pad(np.abs(words[1:-1] - mean), ((3, 3), (0, 0)))
    # the departures of the samples beside it hold half of the jump: those beyond them do not
    usual = np.max([off[k : len(off) - 6 + k] for k in (0, 1, 5, 6)], axis=0)
    off = off[3:-3]
    jumps = off > np.maximum(LEAST_JUMP, JUMPS * usual)
    flipped = jumps & (np.abs(after - before) < RETURNS * off) & (jumps.sum(axis=1, keepdims=True) == 1)
    right = words.copy()
    right[1:-1][flipped] = mean[flipped]
    return right


def _means(samples: Samples, size: int) -> Samples:
    """Means of `size` samples each; a mark on one of them marks the mean."""
    n = len(samples) // size

    def mean(values: Vector) -> Vector:
        return np.asarray(values.reshape(n, size, *values.shape[1:]).mean(1))

    def marked(values: Mask) -> Mask:
        return np.asarray(values.reshape(n, size).any(1))

    return Samples(
        mean(samples.t),
        mean(samples.acc),
        mean(samples.gyr),
        mean(samples.temperature_c),
        marked(samples.gap),
        marked(samples.acc_clipped),
        marked(samples.gyr_clipped),
    )
