"""Downsampling by means over blocks of samples, aligned to the end of the flat segment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Mask, Recording, Vector
from ..rests.flat import Flat
from ..rests.intervals import Intervals

# A rate that follows a hand's motion, with few enough samples for a search.
SEARCH_HZ = 50.0


def downsampled(recording: Recording, flat: Flat, rate_hz: float) -> tuple[Recording, tuple[int, int]]:
    """Return the recording at about `rate_hz` or a little more, by means over blocks, and its flat segment.

    Incomplete blocks at either end are left out. A block with a gap or a clipped sample is marked so.
    """
    size = _size(recording, rate_hz)
    if size < 2:
        return recording, (flat.first, flat.last)
    start = flat.last % size
    m = (len(recording) - start) // size
    used = slice(start, start + m * size)

    def mean(x: Vector) -> Vector:
        return means(x, recording, flat, rate_hz)

    def marked(x: Mask) -> Mask:
        return np.asarray(x[used].reshape(m, size).any(1))

    thin = replace(
        recording,
        t=mean(recording.t),
        acc=mean(recording.acc),
        gyr=mean(recording.gyr),
        temperature_c=mean(recording.temperature_c),
        gap=marked(recording.gap),
        acc_clipped=marked(recording.acc_clipped),
        gyr_clipped=marked(recording.gyr_clipped),
        flat=None,
    )
    return thin, (-((start - flat.first) // size), (flat.last - start) // size)


def means(x: Vector, recording: Recording, flat: Flat, rate_hz: float) -> Vector:
    """Return means (m, ...) of x (n, ...), which has a row for each sample of the recording, over the blocks."""
    size = _size(recording, rate_hz)
    if size < 2:
        return x
    start = flat.last % size
    m = (len(x) - start) // size
    return np.asarray(np.einsum("ij...->i...", x[start : start + m * size].reshape(m, size, *x.shape[1:])) / size)


def blocks(runs: Intervals, recording: Recording, flat: Flat, rate_hz: float) -> Intervals:
    """Return the blocks (k, 2), first and last + 1, that lie within runs (k, 2) of samples."""
    size = _size(recording, rate_hz)
    if size < 2:
        return runs
    first, last = (runs - flat.last % size).T
    return np.stack([np.maximum(-(-first // size), 0), last // size], axis=1)


def _size(recording: Recording, rate_hz: float) -> int:
    """Return the number of samples in a block."""
    return int(recording.rate_hz / rate_hz * (1.0 + 1e-6))
