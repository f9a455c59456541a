"""Frames in which a transfer flipped one bit, told from what the sensor measured, and set right.

A flipped bit changes one word of one frame by a power of two, and the next frame is as the one before. A blow moves
several words, and lasts for more than one frame behind the low-pass filter. So a word is taken for flipped where it
jumps by T or more from the mean of its neighbours, these agree within R or a quarter of the jump, no other word of its
frame jumps, and one bit turned back brings it within R of that mean. R is six times the median of such differences so
far, and T six times R: smaller flips are left, since they are within what noise and motion do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int16]

WITHIN, BEYOND = 6.0, 6.0
# counts: of a sensor without noise, and the least jump
FLOOR, LEAST_JUMP = 8.0, 128.0
# the median goes by so much of itself towards each frame, however far that is
STEP, START, LEAST_MEDIAN = 0.05, 30.0, 1.0
BITS = (1 << np.arange(16)).astype(np.uint16)


class Flips:
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

    def mended(self, frames: Counts, last: Counts) -> Counts:
        """`frames`, with what is flipped set right where both of its neighbours are known.

        The last of them is known only with the next: then `last`, the stored frames that end with it, is set right.
        """
        n = len(self._before)
        run = np.concatenate((self._before, frames))
        if len(run) > 2:
            for at, word in self._jumps(run):
                run[at, word] = self._turned_back(run, at, word)
                if at == n - 1 and len(last):
                    last[-1, word] = run[at, word]
        self._before = run[-2:].copy()
        return run[n:]

    def _jumps(self, run: Counts) -> list[tuple[int, int]]:
        """Frame and word of each jump that returns, where no other word of the frame jumps."""
        wide = run.astype(np.float64)
        off = np.abs(wide[1:-1] - (wide[:-2] + wide[2:]) / 2)
        near = WITHIN * self._median + FLOOR
        jump = off >= np.maximum(LEAST_JUMP, BEYOND * near)
        back = np.abs(wide[2:] - wide[:-2]) <= np.maximum(near, off / 4)
        steps = np.sign(off - self._median).sum(axis=0)
        self._median = np.maximum(self._median * np.exp(STEP * steps), LEAST_MEDIAN)
        alone = jump & back & (jump.sum(axis=1) == 1)[:, None]
        return [(int(at) + 1, int(word)) for at, word in np.argwhere(alone)]

    def _turned_back(self, run: Counts, at: int, word: int) -> np.int16:
        """The word with one bit turned back, where that makes it as its neighbours; else as it is."""
        mean = (float(run[at - 1, word]) + float(run[at + 1, word])) / 2
        each = (run[at, word].astype(np.uint16) ^ BITS).astype(np.int16)
        best = each[np.argmin(np.abs(each - mean))]
        if abs(best - mean) > WITHIN * self._median[word] + FLOOR:
            return np.int16(run[at, word])
        self.found += 1
        return np.int16(best)
