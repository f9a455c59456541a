"""What the chip's driver asks of a bus, and a record of each access."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol


class Reply(NamedTuple):
    """Bytes read, and when.

    Attributes
    ----------
    data : what was read. t_ns : the bus's clock.
    host_ns : the host's clock when it heard of that; None where the bus's clock is the host's.
    """

    data: bytes
    t_ns: int
    host_ns: int | None = None


class Bus(Protocol):
    """Moves register reads and writes, and carries the time (ns, in the bus's own clock).

    Linux I2C, the replay and the simulated chip are buses; so is a tap that records one of them.
    Every method raises BusError where the transfer fails; a replay raises EndOfCapture at its end.
    """

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on; FIFO_R_W does not auto-increment. Time: when the read began."""
        ...

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the bus's clock shows `t_ns` (a replay and a fast simulation return at once)."""
        ...

    def close(self) -> None:
        """Let go of the device."""
        ...


class Files(Protocol):
    """The same of what a driver of the kernel tells in files: instead of a register the name of one.

    `iio:device0/in_accel_scale` is an attribute, `iio:device0` its buffer, `iio:device0/` the list of its attributes.
    """

    def read(self, register: str, count: int) -> Reply:
        """Up to `count` bytes of a file, without waiting for any."""
        ...

    def write(self, register: str, data: bytes) -> int:
        """Write an attribute, and return the time."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """See Bus."""
        ...

    def close(self) -> None:
        """See Bus."""
        ...


class Failure(NamedTuple):
    """The error with which a transfer failed, as plain words; `str` is its sentence."""

    name: str
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}."


@dataclass(frozen=True)
class Transaction:
    """One register access as it happened.

    Attributes
    ----------
    op : read or write. register : address, or of Files the name. data : bytes moved. t_ns : the bus's clock.
    error : None, or how the transfer failed (then data holds what was to be written).
    count : bytes asked for (reads) or given (writes). host_ns : of a reply, see Reply.
    """

    op: Literal["read", "write"]
    register: Any
    count: int
    data: bytes
    t_ns: int
    error: Failure | None = None
    host_ns: int | None = None
