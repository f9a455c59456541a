"""A serial line to an emulated bridge, as a port, in a time that runs only while the host waits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from ...sources.bridge.port import BAUDS, Chunk
from ...sources.bridge.port_errors import port_gone

STEP_NS = 500_000
BITS_A_BYTE = 10
# the host's clock and the bridge's begin at different times
HOST_AHEAD_NS = 7_000_000_000

Spoil = Callable[[bytes], bytes]


class LineEnd(Protocol):
    """What is at the other end."""

    def receive(self, data: bytes) -> None:
        """Bytes came in."""
        ...

    def work(self) -> bytes:
        """Do what there is to do, and return what goes out."""
        ...


class SteppedClock(Protocol):
    """A clock that can be moved on."""

    def now(self) -> int:
        """What it shows, ns."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """Go on to `t_ns`."""
        ...


class EmulatedLine:
    """A port whose other end is `device`; `clock` is the device's, too.

    Parameters
    ----------
    latency_ns : how long an adapter holds back what the device sends. burst_ns : it hands over what came once in
        so long, as USB does; 0: as it comes. step_ns : how often the device works.

    Attributes
    ----------
    device : may be replaced: that is a reset. to_host, to_device : what the line makes of bytes.
    unplugged : the port is gone while this is set. written : what the host has sent.
    """

    def __init__(
        self,
        device: LineEnd,
        clock: SteppedClock,
        latency_ns: int = 1_000_000,
        burst_ns: int = 0,
        step_ns: int = STEP_NS,
    ) -> None:
        self.name, self.bauds = "the emulated line", BAUDS[:1]
        self.device = device
        self.to_host: Spoil = _unchanged
        self.to_device: Spoil = _unchanged
        self.unplugged = False
        self.written = bytearray()
        self._clock, self._latency_ns, self._burst_ns = clock, latency_ns, burst_ns or 1
        self._step_ns = step_ns
        self._coming: deque[Chunk] = deque()
        self._free_ns = 0

    def now_ns(self) -> int:
        """The host's clock."""
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
        """See Port; it runs at any."""

    def reopen(self, until_ns: int) -> None:
        """See Port."""
        while self.unplugged and self.now_ns() < until_ns:
            self._step()
        self._check()

    def revive(self, until_ns: int) -> None:
        """See Port; the device starts by itself."""

    def close(self) -> None:
        """Nothing to let go of."""

    def _step(self) -> None:
        self._clock.sleep_until(self._clock.now() + self._step_ns)
        data = self.device.work()
        if data and not self.unplugged:
            data = self.to_host(data)
            sent_ns = max(self._free_ns, self.now_ns()) + len(data) * BITS_A_BYTE * 1_000_000_000 // self.bauds[0]
            self._free_ns = sent_ns
            heard_ns = -(-(sent_ns + self._latency_ns) // self._burst_ns) * self._burst_ns
            self._coming.append(Chunk(data, heard_ns))

    def _check(self) -> None:
        if self.unplugged:
            self._coming.clear()
            raise port_gone(self.name)


def _unchanged(data: bytes) -> bytes:
    return data
