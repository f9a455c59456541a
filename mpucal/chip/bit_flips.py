"""Filter that repairs bits flipped on the bus, recognised by what the sensor measured before and after.

A flipped bit changes one word of one frame by a power of two, and the next frame is as the one before. A blow moves
several words, and lasts for more than one frame behind the low-pass filter. So a word counts as flipped if it jumps by
T or more from the mean of its neighbours, these agree within R or a quarter of the jump, no other word of its frame
jumps, and inverting one bit brings it within R of that mean. R is six times the running median of such differences, and
T six times R: smaller flips are left, since they are within noise and motion. `flips.cpp` finds the jumps and follows
the median.

The last frame of a poll has no frame after it yet. It waits for the next poll if it may be flipped, so that nobody sees
a flipped word.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from ._flips import until_jumps

Counts = NDArray[np.int16]

# A count is near the mean of its neighbours within this many median differences, and this many counts more.
NEAR_MEDIANS, NEAR_COUNTS = 6.0, 8.0
# Median difference [counts] of consecutive samples of a sensor in the hand.
INITIAL_MEDIAN = 30.0
# A word that jumps by T or more and returns has made a step of at least 7/8 T: T is 6 R or more.
LEAST_STEP = 5.25


class BitFlipFilter:
    """Filter of the frames (n, words) of one stream.

    Attributes
    ----------
    repaired : number of words repaired so far.
    """

    def __init__(self, words: int) -> None:
        self.repaired = 0
        self._median = np.full(words, INITIAL_MEDIAN)
        self._before: Counts = np.zeros((0, words), np.int16)

    def reset(self) -> None:
        """Forget the last frames: the next ones do not follow on them."""
        self._before = self._before[:0]

    @property
    def is_open(self) -> bool:
        """True if the last frame may be flipped: it must wait for the next one."""
        rows = self._before.tolist()
        return len(rows) == 2 and any(
            abs(last - before) >= LEAST_STEP * near
            for before, last, near in zip(*rows, self._near.tolist(), strict=True)
        )

    def repair(self, frames: Counts, waiting: Counts) -> Counts:
        """Return `frames` with the flipped words repaired that have a neighbour on both sides.

        The frame before them, the last one that is `waiting`, is repaired in its place.
        """
        n = len(self._before)
        run = np.concatenate((self._before, frames))
        if len(run) > 2:
            _, jumps = until_jumps(run, np.array([len(run)]), self._median)
            for at, word in jumps:
                run[at, word] = self._repaired_word(run, at, word)
                if at == n - 1:
                    waiting[-1, word] = run[at, word]
        self._before = run[-2:].copy()
        return run[n:]

    def skip_clean(self, frames: Counts, lengths: NDArray[np.int64]) -> int:
        """Follow the leading polls, of `lengths` (k,) frames each, that `repair` would not change; return their number.

        It is 0 before two frames were seen.
        """
        n = len(self._before)
        if n < 2:
            return 0
        run, ends = np.concatenate((self._before, frames)), n + np.cumsum(lengths)
        polls, _ = until_jumps(run, ends, trial := self._median.copy())
        if polls < len(ends):
            # The median has moved on with the poll that has jumps: follow the polls before it again.
            until_jumps(run, ends[:polls], trial := self._median.copy())
        self._median, end = trial, int(ends[polls - 1]) if polls else n
        self._before = run[end - 2 : end].copy()
        return polls

    def _repaired_word(self, run: Counts, at: int, word: int) -> np.int16:
        """Return the word with one bit inverted if that brings it near its neighbours' mean; else unchanged."""
        mean = (float(run[at - 1, word]) + float(run[at + 1, word])) / 2
        each = (run[at, word].astype(np.uint16) ^ (1 << np.arange(16, dtype=np.uint16))).astype(np.int16)
        best = each[np.argmin(np.abs(each - mean))]
        if abs(best - mean) > self._near[word]:
            return np.int16(run[at, word])
        self.repaired += 1
        return np.int16(best)

    @property
    def _near(self) -> Vector:
        """Limits R (words,)."""
        return NEAR_MEDIANS * self._median + NEAR_COUNTS
