"""What befalls 16-bit words between a sensor and a file.

Each is a frozen dataclass; `garble(counts, rng)` takes and gives (n, 6) int32: the accelerometer's x, y, z, then the
gyroscope's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .chip import Counts

LOW = 0xFF


class Digits(Protocol):
    """One thing that befalls words."""

    def garble(self, counts: Counts, rng: np.random.Generator) -> Counts:
        """The words as they arrive."""
        ...


@dataclass(frozen=True)
class LowByteZero:
    """The low byte of one accelerometer axis is always 0."""

    def garble(self, counts: Counts, rng: np.random.Generator) -> Counts:
        """See Digits."""
        counts[:, rng.integers(3)] &= ~LOW
        return counts


@dataclass(frozen=True)
class Flipped:
    """A bit of each byte is flipped with this probability."""

    per_byte: float = 1.0 / 2000.0

    def garble(self, counts: Counts, rng: np.random.Generator) -> Counts:
        """See Digits."""
        words = counts.astype(np.int16).view(np.uint16)
        for byte in (0, 8):
            hit = rng.random(words.shape) < self.per_byte
            words[hit] ^= (1 << rng.integers(byte, byte + 8, int(hit.sum()))).astype(np.uint16)
        return words.view(np.int16).astype(np.int32)


@dataclass(frozen=True)
class Torn:
    """High and low byte are read one after the other: with this probability the high one is of the sample before."""

    share: float = 0.02

    def garble(self, counts: Counts, rng: np.random.Generator) -> Counts:
        """See Digits."""
        torn = rng.random(counts.shape) < self.share
        torn[0] = False
        before = np.roll(counts, 1, axis=0)
        return np.where(torn, (before & ~LOW) | (counts & LOW), counts)


@dataclass(frozen=True)
class SignedLow:
    """The low byte is read as a signed number: where it is 128 or more, the word is 256 too small."""

    def garble(self, counts: Counts, rng: np.random.Generator) -> Counts:
        """See Digits."""
        return counts - 256 * ((counts & LOW) >= 128)
