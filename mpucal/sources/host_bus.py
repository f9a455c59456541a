"""Common parts of the buses of this computer: clock, times of reads, the search for the chip, its lock, and errors.

Source of the errors' meanings: Linux Documentation/i2c/fault-codes.rst.
"""

from __future__ import annotations

import errno
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..chip.access import Reply
from ..chip.driver import TIMED_READS
from ..chip.families import PARTS
from ..chip.losses import Loss
from ..chip.port import TRIES
from ..chip.registers import ADDRESSES, FIFO_R_W
from ..errors import BusError, BusHeld, LateRead, NoAnswer

DEVICES = Path("/dev")
SYSFS_DEVICES = Path("/sys/bus/i2c/devices")

WIRES = "check VCC, GND, SDA and SCL, and that AD0 is tied to GND (0x68) or to VCC (0x69)"

_TRANSFER = {
    errno.EIO: (
        "a transfer broke off",
        "check the connectors, shorten the wires, or use a slower bus",
    ),
    errno.EAGAIN: ("another master took the I2C bus", "do not use another master on this bus"),
    errno.EBUSY: (
        "a driver of the kernel holds the chip",
        "remove its overlay, or: echo {chip} | sudo tee /sys/bus/i2c/devices/{chip}/driver/unbind; but if it is a"
        " clock's driver (rtc-ds1307), keep it, tie AD0 to VCC and give --address 0x69",
    ),
    errno.EOPNOTSUPP: (
        "the adapter does not support this transfer",
        "connect the chip to another adapter",
    ),
    errno.ENODEV: ("the adapter is gone", "plug it in again, and start again"),
}


def device_error(error: OSError, path: str, kind: str, group: str, there: str) -> BusError:
    """Convert the error of the device at `path`.

    Parameters
    ----------
    kind : such as "an I2C bus". group : of the users who may use it. there : remedy for a wrong path.
    """
    name = kind.partition(" ")[2]
    if error.errno == errno.ENOENT:
        return BusError(f"there is no {name} {path}", there)
    if error.errno in (errno.EACCES, errno.EPERM):
        remedy = f"add yourself to its group: `sudo usermod -aG {group} $USER`, then log in again"
        return BusError(f"no permission to use {path}", remedy)
    if error.errno in (errno.ENOTTY, errno.EISDIR, errno.EINVAL):
        return BusError(f"{path} is not {kind}", there)
    if error.errno in (errno.ENXIO, errno.ENODEV, errno.ESHUTDOWN):
        return BusError(f"the {name} {path} is gone", "plug it in or load its driver, and start again")
    return BusError(f"{path} does not work ({error.strerror})", "check the wires and the driver, and start again")


def transfer_error(error: OSError, path: str, address: int) -> BusError:
    """Convert the error of a failed transfer with the chip at `address`."""
    if error.errno != errno.EBUSY and path.startswith("/") and not Path(path).exists():
        # A USB adapter that was unplugged reports EIO.
        what, remedy = _TRANSFER[errno.ENODEV]
        return BusError(f"{what} ({path})", remedy)
    if error.errno in (errno.EREMOTEIO, errno.ENXIO):
        return no_answer_error(path, (address,))
    if error.errno == errno.ETIMEDOUT:
        return BusHeld(
            f"the I2C bus does not become free (0x{address:02x} on {path})",
            "a wire holds SDA or SCL low, or pull-ups are missing: check for shorts,"
            " and switch the chip's supply off and on",
        )
    what, remedy = _TRANSFER.get(
        error.errno or 0,
        (f"a transfer failed ({error.strerror})", "check the wires, and start again"),
    )
    chip = f"{_number(path) or 'N'}-{address:04x}"
    if error.errno == errno.EBUSY and (iio := _iio_device(chip)):
        remedy = f"use --iio {iio} instead of --bus; or {remedy}"
    return BusError(f"{what} (0x{address:02x} on {path})", remedy.format(chip=chip))


def no_answer_error(path: str, addresses: Sequence[int]) -> NoAnswer:
    """Return the error of a bus on which nothing acknowledges any of `addresses`."""
    places = " or ".join(f"0x{address:02x}" for address in addresses)
    number = _number(path)
    scan = f"; `i2cdetect -y {number}` shows which addresses answer" if number else ""
    return NoAnswer(f"nothing answers at {places} on {path}", WIRES + scan)


def _iio_device(chip: str) -> str:
    """Return the IIO device that a driver of the kernel made of `chip`; empty if there is none."""
    return next((path.name for path in sorted((SYSFS_DEVICES / chip).glob("iio:device*"))), "")


def _number(path: str) -> str:
    """Return the number of the adapter; empty if its path has none."""
    number = path.rpartition("i2c-")[2]
    return number if number.isdecimal() else ""


def other_buses() -> str:
    """Return the remedy for a wrong bus: the buses that there are."""
    buses = sorted(str(path) for path in DEVICES.glob("i2c-*"))
    if buses:
        return f"use one of {', '.join(buses)}"
    return "enable I2C (on a Raspberry Pi: `sudo raspi-config nonint do_i2c 0`) and load `i2c-dev`"


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


def find_chip(path: str, only: int | None, who_am_i: Callable[[int], int]) -> int:
    """Return the first address at which a known part answers `who_am_i`, else the first at which anything answers.

    `only` : the one address to ask; None: ADDRESSES.

    Each is asked again if it is silent: one acknowledge in a hundred may be lost.

    Raises
    ------
    BusError : the first failure of a transfer if nothing answers. NoAnswer : nothing acknowledges.
    """
    addresses = ADDRESSES if only is None else (only,)
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
