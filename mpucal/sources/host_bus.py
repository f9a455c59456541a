"""Common parts of the buses of this computer: clock, times of reads, the search for the chip, its lock, and errors."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from ..chip.access import Reply
from ..chip.driver import TIMED_READS
from ..chip.families import PARTS
from ..chip.losses import Loss
from ..chip.port import TRIES
from ..chip.registers import FIFO_R_W
from ..errors import BusError, LateRead, NoAnswer
from .i2c_errors import no_answer_error

# With AD0 low, and with AD0 high.
ADDRESSES = (0x68, 0x69)


# Excess over the shortest read: two samples at 1 kHz, and more than a transfer varies by.
LATE_NS = 2_000_000


class HostBus:
    """Base of a bus whose clock is the monotonic clock of the host."""

    def __init__(self) -> None:
        self._shortest_ns: dict[tuple[int | str, int], int] = {}

    def timed_read(self, place: int | str, count: int, matters: bool, transfer: Callable[[], bytes]) -> Reply:
        """Make the read `transfer` of `count` bytes from `place` on, with the time just before it.

        If the time `matters`, a delayed read is repeated: the time is early by at most LATE_NS more than that of the
        shortest read of as many bytes.

        Raises
        ------
        LateRead : the time matters, and all tries were delayed.
        """
        for _ in range(TRIES):
            t_ns = self.now_ns()
            data = transfer()
            took_ns = self.now_ns() - t_ns
            shortest_ns = min(took_ns, self._shortest_ns.get((place, count), took_ns))
            self._shortest_ns[place, count] = shortest_ns
            if took_ns - shortest_ns <= LATE_NS or not matters:
                return Reply(data, t_ns)
        longer_ms = (took_ns - shortest_ns) / 1e6
        what = f"a read took {longer_ms:.0f} ms longer than usual, so that its time is not known"
        raise LateRead(what, Loss.DELAYED.remedy)

    def now_ns(self) -> int:
        """Return the time of the clock."""
        return time.monotonic_ns()

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)


class RegisterBus(HostBus, ABC):
    """Base of a bus that transfers registers in messages of limited length; the time of an access is just before it."""

    def read(self, register: int, count: int) -> Reply:
        """Read `count` bytes from `register` on, in as few messages as possible; see Bus."""
        return self.timed_read(register, count, (register, count) in TIMED_READS, lambda: self._read(register, count))

    def _read(self, register: int, count: int) -> bytes:
        data = b""
        while len(data) < count:
            # FIFO_R_W does not auto-increment.
            place = register if register == FIFO_R_W else register + len(data)
            try:
                data += self._read_part(place, count - len(data))
            except NoAnswer as error:
                # The earlier bytes are lost: this must not count as a transfer that was not acknowledged.
                raise (BusError(error.what, error.remedy) if data else error) from error
        return data

    @abstractmethod
    def _read_part(self, register: int, count: int) -> bytes:
        """Read up to `count` bytes, as many as fit into one message."""


def find_chip(path: str, addresses: Sequence[int], who_am_i: Callable[[int], int]) -> int:
    """Return the first address at which a known part answers `who_am_i`, else the first at which anything answers.

    Each is asked again if it is silent: one acknowledge in a hundred may be lost.

    Raises
    ------
    BusError : the first failure of a transfer if nothing answers. NoAnswer : nothing acknowledges.
    """
    failures: list[BusError] = []
    others: list[int] = []
    for address in addresses:
        for _ in range(TRIES):
            try:
                if who_am_i(address) in PARTS:
                    return address
                others.append(address)
            except NoAnswer:
                continue
            except BusError as error:
                failures.append(error)
            break
    if others:
        return others[0]
    raise next(iter(failures), no_answer_error(path, addresses))


@contextmanager
def converting(convert: Callable[[OSError], BusError]) -> Iterator[None]:
    """Convert an OSError of the `with` block to the BusError of `convert`."""
    try:
        yield
    except OSError as error:
        raise convert(error) from error


def lock_device(handle: int | None, chip: str, remedy: str = "end it", address: int = 0) -> None:
    """Lock `chip`, behind an open device, against other processes, which would empty its FIFO.

    The lock ends with its process. It is on the byte at `address` (fcntl(2)), so that two chips on one bus have two
    locks. A device without locks is not locked.

    Raises
    ------
    BusError : another process has the lock.
    """
    try:
        import fcntl  # noqa: PLC0415 - not on Windows, which has no such bus

        if handle is not None:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, address)
    except (BlockingIOError, PermissionError) as error:
        raise BusError(f"another mpucal uses {chip}", remedy) from error
    except (ImportError, OSError, TypeError):
        return
