"""The line between a simulated vehicle and a station: loses, reorders and repeats packets where asked to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from random import Random

LOSS, REORDER, DUPLICATE = "loss", "reorder", "duplicate"
LOST_SHARE, LATE_SHARE, TWICE_SHARE = 0.2, 0.1, 0.1
LATE_BY = 3


class Line:
    """Carries packets.

    Parameters
    ----------
    faults : of LOSS (one in five is lost), REORDER (one in ten is overtaken), DUPLICATE (one in ten comes twice).
    """

    def __init__(self, faults: Collection[str], seed: int) -> None:
        self._faults = faults
        self._random = Random(seed)
        self._late: list[tuple[int, bytes]] = []

    def carry(self, packets: Sequence[bytes]) -> list[bytes]:
        """What comes out for what goes in now."""
        out: list[bytes] = []
        for data in packets:
            if LOSS in self._faults and self._random.random() < LOST_SHARE:
                continue
            if REORDER in self._faults and self._random.random() < LATE_SHARE:
                self._late.append((LATE_BY, data))
                continue
            out.append(data)
            if DUPLICATE in self._faults and self._random.random() < TWICE_SHARE:
                out.append(data)
            out += [late for left, late in self._late if left == 1]
            self._late = [(left - 1, late) for left, late in self._late if left > 1]
        return out
