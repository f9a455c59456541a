"""Frames in which a transfer flipped one bit, told from what the sensor measured, and set right.

A flipped bit changes one word of one frame by a power of two, and the next frame is as the one before. A blow moves
several words, and lasts for more than one frame behind the low-pass filter. So a word is taken for flipped where it
jumps by T or more from the mean of its neighbours, these agree within R or a quarter of the jump, no other word of its
frame jumps, and one bit turned back brings it within R of that mean. R is six times the median of such differences so
far, and T six times R: smaller flips are left, since they are within what noise and motion do. `flips.cpp` finds the
jumps and follows the median.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._flips import until_jumps

Counts = NDArray[np.int16]

WITHIN, FLOOR = 6.0, 8.0
# of the differences of a sensor in the hand [counts]
START = 30.0
BITS = (1 << np.arange(16)).astype(np.uint16)


class BitFlipFilter:
    """Follows the frames (n, words) of one stream.

    Attributes
    ----------
    found : how many words were set right.
    """

    def __init__(self, words: int) -> None:
        self.found = 0
        self._median = np.full(words, START)
        self._before: Counts = np.zeros((0, words), np.int16)

    def forget(self) -> None:
        """What follows does not follow on what came."""
        self._before = self._before[:0]

    def repair(self, frames: Counts, last: Counts) -> Counts:
        """`frames`, with what is flipped set right where both of its neighbours are known.

        The last of them is known only with the next: then `last`, the stored frames that end with it, is set right.
        """
        n = len(self._before)
        run = np.concatenate((self._before, frames))
        if len(run) > 2:
            _, jumps = until_jumps(run, np.array([len(run)]), self._median)
            for at, word in jumps:
                run[at, word] = self._turned_back(run, at, word)
                if at == n - 1 and len(last):
                    last[-1, word] = run[at, word]
        self._before = run[-2:].copy()
        return run[n:]

    def skip_clean(self, frames: Counts, lengths: NDArray[np.int64]) -> int:
        """How many polls, of `lengths` (k,) frames each, `repair` would leave as they are; they were followed.

        None where it has not seen two frames yet.
        """
        n = len(self._before)
        if n < 2:
            return 0
        run, ends = np.concatenate((self._before, frames)), n + np.cumsum(lengths)
        polls, _ = until_jumps(run, ends, trial := self._median.copy())
        if polls < len(ends):
            # the median has moved on with the poll that has jumps
            until_jumps(run, ends[:polls], trial := self._median.copy())
        self._median, end = trial, int(ends[polls - 1]) if polls else n
        self._before = run[end - 2 : end].copy()
        return polls

    def _turned_back(self, run: Counts, at: int, word: int) -> np.int16:
        """The word with one bit turned back, where that makes it as its neighbours; else as it is."""
        mean = (float(run[at - 1, word]) + float(run[at + 1, word])) / 2
        each = (run[at, word].astype(np.uint16) ^ BITS).astype(np.int16)
        best = each[np.argmin(np.abs(each - mean))]
        if abs(best - mean) > WITHIN * self._median[word] + FLOOR:
            return np.int16(run[at, word])
        self.found += 1
        return np.int16(best)
