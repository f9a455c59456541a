"""The samples of a session so far, averaged to at most 200 Hz for the live fits."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from ...calibration.lone_jumps import BESIDE, without_lone_jumps
from ...data import Mask, Recording, Samples, Sensor, Vector

# Means of what comes faster: a hand does nothing that is not seen at this rate.
MOST_HZ = 200.0


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
        # what came last, as it came, the first `_lead` of it in `_done` as well: those before it, mended for good
        self._done, self._open, self._lead = Samples.empty(), Samples.empty(), 0
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
        kept = _cut(self._mended(), 0, first // self._size)
        self._done, self._open, self._lead = kept, Samples.empty(), 0
        self._rest, self._torn = Samples.empty(), True

    def recording(self) -> Recording:
        """All of them, without the flips that the decoder saw too late."""
        return Recording(**vars(self._mended()), sensor=self._sensor)

    def _mended(self) -> Samples:
        """All, of which only the last few have not been looked at before."""
        begin = len(self._done) - self._lead
        self._open, self._parts = Samples.joined([self._open, *self._parts]), []
        looked = without_lone_jumps(Recording(**vars(self._open), sensor=self._sensor))
        news = _cut(looked, self._lead, len(looked))
        whole = Samples.joined([self._done, news])
        settled = max(len(whole) - BESIDE, len(self._done))
        self._done, self._lead = _cut(whole, 0, settled), min(BESIDE, settled - begin)
        self._open = _cut(self._open, settled - self._lead - begin, len(self._open))
        return whole


def _cut(samples: Samples, first: int, last: int) -> Samples:
    return Samples(*(getattr(samples, f.name)[first:last] for f in fields(Samples)))


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
