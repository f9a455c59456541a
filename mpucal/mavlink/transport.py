"""The protocol of what moves a link's bytes and has the clock: UDP, TCP, serial, a .tlog, a simulated vehicle."""

from __future__ import annotations

import time
from typing import NamedTuple, Protocol

US = 1_000
# who asked for bytes until a time, and gets them so much later, stood still meanwhile: SIGSTOP, a suspended computer
PAUSE_NS = 3_000_000_000


class ReceivedBytes(NamedTuple):
    """Bytes that arrived: a datagram or a piece of a stream; from where, and when (ns since 1970, whole us)."""

    data: bytes
    address: str
    t_ns: int


class Transport(Protocol):
    """Moves bytes, and has the clock.

    Attributes
    ----------
    name : where it leads, in words.
    datagrams : bytes come in datagrams of whole packets; else as a stream.
    outward : it leads to one partner that the person named, who may be spoken to at once.
    """

    name: str
    datagrams: bool
    outward: bool

    def now_ns(self) -> int:
        """ns since 1970, in whole us, as a .tlog counts; never goes back."""
        ...

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """The next bytes, waited for until `until_ns`; None where none came. EndOfCapture, LinkError."""
        ...

    def send(self, data: bytes, address: str | None) -> None:
        """Send to `address`, as `receive` gave it; None: to the partner of an outward transport. LinkError."""
        ...

    def restrict(self, address: str | None) -> None:
        """From now on hear that address alone, where the transport can see to it; None: whoever sends, as at first."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class SteadyClock:
    """Time of day at the start, counted on by the clock that nobody sets."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """ns since 1970, in whole us."""
        return (self._offset_ns + time.monotonic_ns()) // US * US
