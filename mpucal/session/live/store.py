"""The samples of a session so far, averaged to at most 200 Hz for the live fits."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from ...data import Mask, Recording, Samples, Sensor, Vector

# Faster samples are averaged to this rate: no motion of a hand is lost.
MOST_HZ = 200.0


class SampleStore:
    """Samples so far, with the times that were known when they arrived.

    Parameters
    ----------
    sensor : its rate decides over how many samples to average.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        rate_hz = sensor.rate_hz or MOST_HZ
        self._size = max(int(rate_hz / MOST_HZ * (1.0 + 1e-6)), 1)
        self._parts: list[Samples] = []
        self._rest = Samples.empty()
        self._gap_next = False

    def add(self, samples: Samples) -> None:
        """Append samples."""
        if self._gap_next and len(samples):
            samples = replace(samples, gap=np.append(True, samples.gap[1:]))
            self._gap_next = False
        if self._size > 1:
            pending = Samples.joined([self._rest, samples])
            used = len(pending) // self._size * self._size
            samples, self._rest = _means(_cut(pending, 0, used), self._size), _cut(pending, used, len(pending))
        if len(samples):
            self._parts.append(samples)

    def forget(self, first: int) -> None:
        """Drop the added samples from number `first` on, and mark a gap before the next one."""
        self._parts = [_cut(self.samples(), 0, first // self._size)]
        self._rest, self._gap_next = Samples.empty(), True

    def recording(self) -> Recording:
        """Return all samples."""
        return Recording(**vars(self.samples()), sensor=self._sensor)

    def samples(self) -> Samples:
        """Return all samples."""
        self._parts = [Samples.joined(self._parts)]
        return self._parts[0]


def _cut(samples: Samples, first: int, last: int) -> Samples:
    return Samples(*(getattr(samples, f.name)[first:last] for f in fields(Samples)))


def _means(samples: Samples, size: int) -> Samples:
    """Return the means of `size` samples each; a gap or clipping of one of them marks the mean."""

    def mean(values: Vector | Mask) -> Any:
        groups = values.reshape(len(values) // size, size, *values.shape[1:])
        return groups.any(1) if values.dtype == bool else groups.mean(1)

    return Samples(*(mean(getattr(samples, f.name)) for f in fields(Samples)))
