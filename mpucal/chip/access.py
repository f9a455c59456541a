"""Interface between the chip's driver and a bus, and the records of a capture: register accesses and session events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol

# Names of session events. KEY holds the key under its own name; LATE: an answer was late; FORGET: samples
# first..last-1 are not used; RESUMED: the session was resumed, and had stopped at the time SAMPLED_NS of the samples'
# clock; UTC: the time of day, ns since 1970.
KEY, LATE, FORGET, RESUMED, UTC = "key", "late", "forget", "resumed", "utc"
SAMPLED_NS = "sampled_ns"
# Of a vehicle: the link was opened; what it sends counts from here on; reading had paused, see SAMPLED_NS; nothing came
# until this time.
OPENED, BEGUN, PAUSED, END = "session", "begun", "paused", "end"
ABORT = "abort"  # the key that ends a session


class Reply(NamedTuple):
    """Bytes read, with the time of reading.

    Attributes
    ----------
    data : bytes read. t_ns : time of the bus's clock.
    host_ns : time of the host's clock when the reply arrived; None if the bus uses the host's clock.
    """

    data: bytes
    t_ns: int
    host_ns: int | None = None


class Bus(Protocol):
    """Transport of register reads and writes, and of the time (ns, in the bus's own clock).

    Linux I2C, the replay and the simulated chip are buses; so is a tap that records one of them, and so are the files
    of a kernel driver, whose names stand in place of registers: `iio:device0/in_accel_scale` is an attribute,
    `iio:device0` its buffer, `iio:device0/` the list of its attributes.
    Every method raises BusError if the transfer fails; a replay raises EndOfCapture at its end.
    """

    def read(self, register: Any, count: int) -> Reply:
        """Read `count` bytes from `register` on, or up to `count` of a file, without blocking.

        FIFO_R_W does not auto-increment. The time is the read's beginning.
        """

    def write(self, register: Any, data: bytes) -> int:
        """Write `data` from `register` on, or to a file, and return the time."""

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the bus's clock shows `t_ns` (a replay and a fast simulation return at once)."""

    def close(self) -> None:
        """Release the device."""


class Failure(NamedTuple):
    """Error of a failed transfer as plain words; `str` is its sentence."""

    name: str
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}."


@dataclass(frozen=True)
class Transaction:
    """Register access as it happened.

    Attributes
    ----------
    op : read or write. register : address, or the name of a file. data : bytes moved.
    t_ns : time of the bus's clock. host_ns : see Reply.
    error : None, or the error of a failed transfer (then `data` holds the bytes of the attempted write).
    count : bytes requested (reads) or given (writes).
    """

    op: Literal["read", "write"]
    register: Any
    count: int
    data: bytes
    t_ns: int
    error: Failure | None = None
    host_ns: int | None = None


@dataclass(frozen=True)
class SessionEvent:
    """Event that reached the session by another way than the bus: a key press, an option, the end.

    Attributes
    ----------
    name : kind of the event. t_ns : time of the bus's clock. data : of JSON's types.
    """

    name: str
    t_ns: int
    data: Mapping[str, Any] = field(default_factory=dict)
