"""The line between a simulated vehicle and a station: loses, reorders and repeats packets where asked to."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from ..faults import FAULTS, Fault, Where

LATE_BY = 3


class PacketLine:
    """Carries packets.

    Parameters
    ----------
    faults : those of the link are looked at: loss, reorder, duplicate.
    """

    def __init__(self, faults: Sequence[Fault], seed: int) -> None:
        self._suffered = {fault.name for fault in faults if fault.kind.where is Where.LINK}
        self._random = Random(seed)
        self._late: list[tuple[int, bytes]] = []

    def carry(self, packets: Sequence[bytes]) -> list[bytes]:
        """What comes out for what goes in now."""
        out: list[bytes] = []
        for data in packets:
            if self._befalls("loss"):
                continue
            if self._befalls("reorder"):
                self._late.append((LATE_BY, data))
                continue
            out.append(data)
            if self._befalls("duplicate"):
                out.append(data)
            out += [late for left, late in self._late if left == 1]
            self._late = [(left - 1, late) for left, late in self._late if left > 1]
        return out

    def _befalls(self, name: str) -> bool:
        return name in self._suffered and self._random.random() < FAULTS[name].share
