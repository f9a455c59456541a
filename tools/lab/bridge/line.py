"""Serial line to an emulated bridge, as a port, in a time that passes only while the host waits; and its faults."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from mpucal.bridge.port import BAUDS, Chunk
from mpucal.bridge.port_errors import port_gone
from mpucal.simulated.chip.bus import SimulatedClock
from mpucal.simulated.faults import FAULTS

STEP_NS = 500_000
BITS_A_BYTE = 10
# The clocks of host and bridge have different origins.
HOST_AHEAD_NS = 7_000_000_000

LATE = "late"

Damage = Callable[[bytes], bytes]


class EmulatedLine:
    """Port whose other end is `device`; both have the same `clock`.

    Parameters
    ----------
    device : takes bytes from the host by `receive`, and by `work` handles them and returns bytes to the host.
    latency_ns : delay of the bytes to the host by an adapter. burst_ns : interval at which they are delivered, as by
        USB; 0: as they come. step_ns : interval of the device's `work`.

    Attributes
    ----------
    device : may be replaced, which is a reset. to_host, to_device : functions that damage bytes on the line.
    unplugged : the port is gone while this is True. written : bytes that the host has sent.
    """

    def __init__(
        self,
        device: Any,
        clock: SimulatedClock,
        latency_ns: int = 1_000_000,
        burst_ns: int = 0,
        step_ns: int = STEP_NS,
    ) -> None:
        self.name = "the emulated line"
        self.bauds: tuple[int, ...] = BAUDS[:1]
        self.device = device
        self.to_host: Damage = _unchanged
        self.to_device: Damage = _unchanged
        self.unplugged = False
        self.written = bytearray()
        self._clock, self._latency_ns, self._burst_ns = clock, latency_ns, burst_ns or 1
        self._step_ns = step_ns
        self._coming: deque[Chunk] = deque()
        self._free_ns = 0

    def now_ns(self) -> int:
        """Return the time of the host's clock."""
        return self._clock.now() + HOST_AHEAD_NS

    def read(self, until_ns: int) -> Chunk | None:
        """See Port."""
        while True:
            self._check()
            if self._coming and self._coming[0].t_ns <= self.now_ns():
                return self._coming.popleft()
            if self.now_ns() >= until_ns:
                return None
            self._step()

    def write(self, data: bytes) -> None:
        """See Port."""
        self._check()
        self.written += data
        self.device.receive(self.to_device(data))

    def set_baud(self, baud: int) -> None:
        """See Port; every rate works."""

    def reopen(self, until_ns: int) -> None:
        """See Port."""
        while self.unplugged and self.now_ns() < until_ns:
            self._step()
        self._check()

    def revive(self, until_ns: int) -> None:
        """See Port; the device needs no start."""

    def close(self) -> None:
        """Do nothing: no device is open."""

    def _step(self) -> None:
        self._clock.sleep_until(self._clock.now() + self._step_ns)
        data = self.device.work()
        if data and not self.unplugged:
            data = self.to_host(data)
            sent_ns = max(self._free_ns, self.now_ns()) + len(data) * BITS_A_BYTE * 1_000_000_000 // self.bauds[0]
            self._free_ns = sent_ns
            arrival_ns = -(-(sent_ns + self._latency_ns) // self._burst_ns) * self._burst_ns
            self._coming.append(Chunk(data, arrival_ns))

    def _check(self) -> None:
        if self.unplugged:
            self._coming.clear()
            raise port_gone(self.name)


def _unchanged(data: bytes) -> bytes:
    return data


class LineFaults:
    """Function that damages the bytes of an EmulatedLine.

    Parameters
    ----------
    at : number of the byte on the line, name of the fault, and a number from 1 to 255 that varies the damage.

    Attributes
    ----------
    number : of the next byte.
    """

    def __init__(self, at: Iterable[tuple[int, str, int]]) -> None:
        self._at = {number: (name, value) for number, name, value in at}
        self.number = 0
        self._held = b""

    def __call__(self, data: bytes) -> bytes:
        """Return the bytes that arrive now; late ones arrive with the next."""
        out, late = bytearray(self._held), False
        self._held = b""
        for byte in data:
            name, value = self._at.get(self.number, ("", 0))
            self.number += 1
            late = late or name == LATE
            spoils = FAULTS[name].spoils if name else None
            made = bytes([byte]) if spoils is None else spoils(byte, value)
            if late:
                self._held += made
            else:
                out += made
        return bytes(out)
