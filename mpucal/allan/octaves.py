"""Overlapping Allan variance over octaves of time, from a stream of samples in constant memory.

    AVAR(tau) = mean of (mean over the next tau - mean over this tau)^2 / 2

(D. W. Allan, 1966; IEEE Std 952, annex C), at tau of 1, 2, 4, ... samples. Up to 16 samples every overlap is counted,
as in allantools' oadev; beyond, means over blocks of a 16th of tau are shifted by one block, which
loses no measurable information, and needs 32 numbers per octave.
"""

from __future__ import annotations

import numpy as np

from ..data import Vector

# distances in samples; beyond the last, which many blocks make a tau
_FIRST = (1, 2, 4, 8, 16)


class _Level:
    """Level of blocks of one length: differences of their means at each distance, and means of pairs."""

    def __init__(self, axes: int, distances: tuple[int, ...]) -> None:
        self.distances = distances
        self.sums = np.zeros((len(distances), axes))
        self.counts = np.zeros(len(distances))
        self._tail, self._odd = np.zeros((axes, 0)), np.zeros((axes, 0))

    def interrupt(self) -> None:
        """Reset after a gap."""
        self._tail, self._odd = self._tail[:, :0], self._odd[:, :0]

    def add(self, blocks: Vector) -> Vector:
        """Add block means (axes, n); return the means of pairs."""
        sums = z = np.concatenate([self._tail, blocks], axis=1)
        for n in _FIRST:
            # sums: of n blocks each, one at every block
            new = min(blocks.shape[1], z.shape[1] - 2 * n + 1)
            if new <= 0:
                break
            if n in self.distances:
                d = sums[:, -new:] - sums[:, -new - n : -n]
                i = self.distances.index(n)
                self.sums[i] += np.einsum("ij,ij->i", d, d) / n**2
                self.counts[i] += new
            sums = sums[:, n:] + sums[:, :-n]
        self._tail = z[:, max(z.shape[1] - 2 * _FIRST[-1] + 1, 0) :]
        pairs = np.concatenate([self._odd, blocks], axis=1)
        even = pairs.shape[1] // 2 * 2
        self._odd = pairs[:, even:]
        return np.asarray(0.5 * (pairs[:, :even:2] + pairs[:, 1:even:2]))


class Octaves:
    """Allan variance of several axes so far.

    Attributes
    ----------
    samples : number of added samples.
    """

    def __init__(self, axes: int) -> None:
        self._axes, self._middle = axes, np.zeros((axes, 1))
        self._levels = [_Level(axes, _FIRST)]
        self.samples = 0

    def add(self, values: Vector, follows: bool = True) -> None:
        """Add samples (axes, n); `follows` is False after a gap."""
        if not values.size:
            return
        if not self.samples:
            # without the mean, which does not matter, no digits are lost
            self._middle = values.mean(1, keepdims=True)
        self.samples += values.shape[1]
        if not follows:
            for level in self._levels:
                level.interrupt()
        blocks, at = np.asarray(values - self._middle), 0
        while blocks.size:
            if at == len(self._levels):
                self._levels.append(_Level(self._axes, _FIRST[-1:]))
            blocks = self._levels[at].add(blocks)
            at += 1

    def variances(self) -> tuple[Vector, Vector, Vector]:
        """Return tau (k,) in samples, Allan variance (k, axes), and number of differences (k,)."""
        sizes = np.concatenate([np.array(level.distances) * 2**at for at, level in enumerate(self._levels)])
        sums = np.concatenate([level.sums for level in self._levels])
        counts = np.concatenate([level.counts for level in self._levels])
        seen = counts > 0
        return sizes[seen], 0.5 * sums[seen] / counts[seen, None], counts[seen]
