"""Access to a bus with retries: the registers of a chip, or the files of a kernel driver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ..errors import BusError, NoAnswer
from .access import Bus, Transaction
from .losses import TransferStats

TRIES = 3
RETRY_NS = 1_000_000

T = TypeVar("T")


class Port:
    """Reads and writes of one bus, each of which is passed to `follow` if it succeeded.

    Every method raises BusError if a transfer failed, and EndOfCapture at the end of a replay.

    Parameters
    ----------
    tries : number of times that a failed access is tried.

    Attributes
    ----------
    stats : counts the transfers. now_ns : last known time of the bus's clock.
    """

    def __init__(
        self,
        bus: Bus,
        follow: Callable[[Transaction], object] = lambda _access: None,
        stats: TransferStats | None = None,
        tries: int = TRIES,
    ) -> None:
        self.stats = TransferStats() if stats is None else stats
        self.now_ns = 0
        self._bus = bus
        self._follow, self._tries = follow, tries

    def read(self, register: Any, count: int) -> bytes:
        """Read `count` bytes from `register` on, or up to `count` of a file."""
        return self._tried(lambda: self._read(register, count))

    def read_destructive(self, register: int, count: int) -> bytes:
        """Read registers whose content the read removes or clears, so that a second read gives something else.

        It is repeated only if nothing was acknowledged: a chip is addressed before it gives its first byte.
        """
        return self._tried(lambda: self._read(register, count), NoAnswer)

    def _read(self, register: Any, count: int) -> bytes:
        data, t_ns, host_ns = self._bus.read(register, count)
        self._pass_on(Transaction("read", register, count, data, t_ns, None, host_ns))
        return data

    def write(self, register: int, value: int) -> None:
        """Write one byte."""
        self.write_block(register, bytes([value]))

    def write_block(self, register: Any, data: bytes) -> None:
        """Write `data` from `register` on in one transfer, or to a file."""
        t_ns = self._tried(lambda: self._bus.write(register, data))
        self._pass_on(Transaction("write", register, len(data), data, t_ns))

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the bus's clock shows `t_ns`."""
        self._bus.sleep_until(t_ns)
        self.now_ns = max(self.now_ns, t_ns)

    def sleep(self, ns: int) -> None:
        """Wait `ns` nanoseconds of bus time."""
        self.sleep_until(self.now_ns + ns)

    def _pass_on(self, access: Transaction) -> None:
        self.now_ns = max(self.now_ns, access.t_ns)
        self._follow(access)

    def _tried(self, access: Callable[[], T], after: type[BusError] = BusError) -> T:
        """Make an access and count it, again after errors of the kind `after`."""
        left = self._tries
        while True:
            self.stats.transfers += 1
            try:
                return access()
            except BusError as error:
                self.stats.count_error(error)
                left -= 1
                if not left or not isinstance(error, after):
                    raise
            self.sleep(RETRY_NS)
            self.stats.retries += 1
