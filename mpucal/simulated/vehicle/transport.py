"""Simulated vehicle as a link's transport, over a line that may lose, reorder and repeat packets."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from random import Random

from ...clocks import US
from ...mavlink.transports import ReceivedBytes
from ..faults import FAULTS, Fault, Where
from .vehicle import SimulatedVehicle


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
                self._late.append((3, data))
                continue
            out.append(data)
            if self._happens("duplicate"):
                out.append(data)
            out += [late for left, late in self._late if left == 1]
            self._late = [(left - 1, late) for left, late in self._late if left > 1]
        return out

    def _happens(self, name: str) -> bool:
        return name in self._names and self._random.random() < FAULTS[name].share


ADDRESS = "the simulated vehicle"
REAL = "real"


class SimulatedTransport:
    """Transport to a vehicle whose time passes only while it is received from; see Transport."""

    datagrams, outward = True, True
    name = ADDRESS

    def __init__(self, vehicle: SimulatedVehicle) -> None:
        self._vehicle = vehicle
        self._line = PacketLine(vehicle.options.fault, vehicle.options.seed)
        self._begun_ns = time.time_ns() // US * US
        self._begun_monotonic_ns = time.monotonic_ns()
        self._queue: deque[ReceivedBytes] = deque()

    @property
    def real_time(self) -> bool:
        """True if its time passes by itself."""
        return self._vehicle.options.pace == REAL

    def now_ns(self) -> int:
        """See Transport."""
        return self._begun_ns + self._vehicle.now_us * US

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        while not self._queue and self.now_ns() < until_ns:
            sent = self._vehicle.run_to_next(-(-(until_ns - self._begun_ns) // US))
            self._keep_pace()
            self._queue.extend(ReceivedBytes(data, ADDRESS, self.now_ns()) for data in self._line.carry(sent))
        return self._queue.popleft() if self._queue else None

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        self._vehicle.receive(data)

    def restrict(self, address: str | None) -> None:
        """See Transport."""

    def close(self) -> None:
        """See Transport."""

    def _keep_pace(self) -> None:
        if self.real_time:
            ahead_ns = self._begun_monotonic_ns + self._vehicle.now_us * US - time.monotonic_ns()
            time.sleep(max(ahead_ns, 0) * 1e-9)
