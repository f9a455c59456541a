"""The samples of a session so far, averaged to at most 200 Hz for the live fits."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from ...calibration.masks import SPIKE_MARGIN, remove_spikes
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
        # `_done` is filtered for good. `_open` is the unfiltered rest, preceded by the last `_lead` samples of `_done`,
        # which the filter needs as neighbours.
        self._done, self._open, self._lead = Samples.empty(), Samples.empty(), 0
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
        kept = _cut(self._filtered(), 0, first // self._size)
        self._done, self._open, self._lead = kept, Samples.empty(), 0
        self._rest, self._gap_next = Samples.empty(), True

    def recording(self) -> Recording:
        """Return all samples, without the bit flips that the decoder recognised too late."""
        return Recording(**vars(self._filtered()), sensor=self._sensor)

    def _filtered(self) -> Samples:
        """Return all samples filtered by `remove_spikes`, which is applied to those since the last call alone."""
        begin = len(self._done) - self._lead
        self._open, self._parts = Samples.joined([self._open, *self._parts]), []
        filtered = remove_spikes(Recording(**vars(self._open), sensor=self._sensor))
        whole = Samples.joined([self._done, _cut(filtered, self._lead, len(filtered))])
        settled = max(len(whole) - SPIKE_MARGIN, len(self._done))
        self._done, self._lead = _cut(whole, 0, settled), min(SPIKE_MARGIN, settled - begin)
        self._open = _cut(self._open, settled - self._lead - begin, len(self._open))
        return whole


def _cut(samples: Samples, first: int, last: int) -> Samples:
    return Samples(*(getattr(samples, f.name)[first:last] for f in fields(Samples)))


def _means(samples: Samples, size: int) -> Samples:
    """Return the means of `size` samples each; a gap or clipping of one of them marks the mean."""

    def mean(values: Vector | Mask) -> Any:
        groups = values.reshape(len(values) // size, size, *values.shape[1:])
        return groups.any(1) if values.dtype == bool else groups.mean(1)

    return Samples(*(mean(getattr(samples, f.name)) for f in fields(Samples)))
