"""Emulated bridge: the program for MicroPython, run by this Python, with any bus as its I2C bus.

It stands for a microcontroller in tests and trials. See firmware_protocol.md.
"""

import errno
from collections.abc import Callable
from typing import Any, TypeVar

from mpucal.bridge import board
from mpucal.bridge.messages import Feature, Status
from mpucal.chip.access import Bus
from mpucal.chip.registers import ADDRESSES
from mpucal.clocks import US
from mpucal.clocks.device_clocks import WRAP
from mpucal.errors import BusError, NoAnswer
from mpucal.result.blob import MAGIC

from .line import EmulatedLine

__all__ = ["EmulatedBridge", "EmulatedLine", "Memory"]

HEADER_BYTES = 8
# Requests of a bridge without features: HELLO to WRITE.
LAST_PLAIN_REQUEST = 4

T = TypeVar("T")


class Memory(board.BlobFiles):
    """Slots for a blob, which outlive the bridge.

    Attributes
    ----------
    slots : bytes of each.
    """

    def __init__(self) -> None:
        super().__init__("")
        self.slots = [b"", b""]

    def load(self, number: int) -> bytes:
        """See BlobFiles."""
        return self.slots[number]

    def keep(self, number: int, data: bytes) -> None:
        """See BlobFiles."""
        self.slots[number] = data

    def remove(self, number: int) -> None:
        """See BlobFiles."""
        self.slots[number] = b""

    @property
    def occupied(self) -> bool:
        """True if a slot holds bytes that are not a blob's."""
        return any(slot and not slot[HEADER_BYTES:].startswith(MAGIC) for slot in self.slots)


class EmulatedBridge(board.Bridge):
    """Bridge with a chip on it; its owner carries its bytes and calls `work`, once a millisecond.

    Parameters
    ----------
    chip : at `address`; None: nothing is connected. now_ns : its clock. memory : for a blob.
    features : optional ones that it has. window : number of requests that it accepts at once.
    """

    name = b"emulated bridge\0"
    files: Memory

    def __init__(
        self,
        chip: Bus | None,
        now_ns: Callable[[], int],
        memory: Memory | None = None,
        *,
        address: int = ADDRESSES[0],
        features: Feature = Feature.STREAM | Feature.BLOB,
        window: int = 4,
    ) -> None:
        self._now_ns, self._features = now_ns, features
        super().__init__([] if chip is None else [_I2c(chip, address)], now_ns)
        self.files, self.window = memory or Memory(), window
        self.files.begun = None
        if not features:
            self.requests = {kind: act for kind, act in self.requests.items() if kind <= LAST_PLAIN_REQUEST}

    def hello(self, *request: Any) -> Any:
        """Answer HELLO; the features say whether the memory holds other data."""
        self.features = self._features | (Feature.OCCUPIED if self.files.occupied else 0)
        return super().hello(*request)

    def clock(self) -> int:
        """Return the time, us."""
        return self._now_ns() // US % WRAP

    def blob_begin(self, length: int) -> Any:
        """Prepare for a blob unless the memory holds other data."""
        if self.files.occupied:
            raise board.Failed(Status.OCCUPIED)
        return super().blob_begin(length)


class _I2c:
    """Bus of a bridge, as machine.I2C has it."""

    def __init__(self, chip: Bus, address: int) -> None:
        self._chip, self._address = chip, address
        self._silent = False

    def readfrom(self, address: int, count: int) -> bytes:
        """Read bytes, to see if the chip answers."""
        silent, self._silent = self._silent, False
        if address != self._address or silent:
            raise OSError(errno.EIO)
        return bytes(count)

    def readfrom_mem(self, _address: int, register: int, count: int) -> bytes:
        """Read `count` bytes from `register` on."""
        return self._tried(lambda: self._chip.read(register, count).data)

    def writeto_mem(self, _address: int, register: int, data: bytes) -> None:
        """Write `data` from `register` on."""
        self._tried(lambda: self._chip.write(register, data))

    def _tried(self, access: Callable[[], T]) -> T:
        try:
            return access()
        except BusError as error:
            self._silent = isinstance(error, NoAnswer)
            raise OSError(errno.EIO) from error
