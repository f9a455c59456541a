"""Line between a simulated vehicle and a station, which may lose, reorder and repeat packets."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from ..faults import FAULTS, Fault, Where

LATE_BY = 3


class PacketLine:
    """Carrier of packets.

    Parameters
    ----------
    faults : of which those of the link count: loss, reorder, duplicate.
    """

    def __init__(self, faults: Sequence[Fault], seed: int) -> None:
        self._names = {fault.name for fault in faults if fault.kind.where is Where.LINK}
        self._random = Random(seed)
        self._late: list[tuple[int, bytes]] = []

    def carry(self, packets: Sequence[bytes]) -> list[bytes]:
        """Return the packets that arrive when these are sent."""
        out: list[bytes] = []
        for data in packets:
            if self._happens("loss"):
                continue
            if self._happens("reorder"):
                self._late.append((LATE_BY, data))
                continue
            out.append(data)
            if self._happens("duplicate"):
                out.append(data)
            out += [late for left, late in self._late if left == 1]
            self._late = [(left - 1, late) for left, late in self._late if left > 1]
        return out

    def _happens(self, name: str) -> bool:
        return name in self._names and self._random.random() < FAULTS[name].share
