"""The transport protocol: a transport moves a link's bytes and has its clock.

UDP, TCP, a serial line, a capture that is replayed and a simulated vehicle are transports.
"""

from __future__ import annotations

import time
from typing import NamedTuple, Protocol

from ..clocks import US, S

# A receive that ends so long after its deadline was interrupted: SIGSTOP, or a suspended computer.
PAUSE_NS = 3 * S


class ReceivedBytes(NamedTuple):
    """A datagram or a piece of a stream, its sender's address, and when it arrived [ns since 1970, whole us]."""

    data: bytes
    address: str
    t_ns: int


class Transport(Protocol):
    """Carrier of a link's bytes.

    Attributes
    ----------
    name : the other end, as messages call it.
    datagrams : bytes come in datagrams of whole packets; otherwise as a stream.
    outward : it leads to one partner that the user named, to whom we may send before anything is received.
    """

    name: str
    datagrams: bool
    outward: bool

    def now_ns(self) -> int:
        """Return the time in ns since 1970, in whole us as in a .tlog; it never decreases."""
        ...

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """Return the next bytes, or None if none come until `until_ns`. Raises EndOfCapture or LinkError."""
        ...

    def send(self, data: bytes, address: str | None) -> None:
        """Send to an address as `receive` gave it; None is the partner of an outward transport. Raises LinkError."""
        ...

    def restrict(self, address: str | None) -> None:
        """Accept bytes from that address alone, None: from everybody. A transport with one partner ignores it."""
        ...

    def close(self) -> None:
        """Release what the transport holds open."""
        ...


class SteadyClock:
    """Time of day at the start, counted on by the monotonic clock, which nobody sets."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return ns since 1970, in whole us."""
        return (self._offset_ns + time.monotonic_ns()) // US * US
