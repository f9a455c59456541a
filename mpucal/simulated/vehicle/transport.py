"""Simulated vehicle as a link's transport, in this process: `--mavlink sim`."""

from __future__ import annotations

import time
from collections import deque

from ...mavlink.transport import US, ReceivedBytes
from .line import PacketLine
from .vehicle import SimulatedVehicle

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
            self._queue.extend(
                ReceivedBytes(data, ADDRESS, self.now_ns()) for data in self._line.carry([s.data for s in sent])
            )
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
