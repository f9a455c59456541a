"""Access to one chip's registers over any bus, with retries; every access is fed to a decoder."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ..errors import BusError, NoAnswer
from .access import Bus
from .decode import Decoder
from .transfer_stats import TransferStats

TRIES = 3
RETRY_NS = 1_000_000

T = TypeVar("T")


class Port:
    """Reads and writes of one chip, each of which `decoder` follows if it succeeded.

    Every method raises BusError if a transfer failed, and EndOfCapture at the end of a replay.

    Attributes
    ----------
    stats : counts the transfers. now_ns : last known time of the bus's clock.
    """

    def __init__(self, bus: Bus, decoder: Decoder, stats: TransferStats | None = None) -> None:
        self.stats = TransferStats() if stats is None else stats
        self.now_ns = 0
        self._bus = bus
        self._decoder = decoder

    def read(self, register: int, count: int) -> bytes:
        """Read `count` bytes from `register` on, in up to three tries."""
        return self._tried(lambda: self._read(register, count))

    def read_destructive(self, register: int, count: int) -> bytes:
        """Read registers whose content the read removes or clears, so that a second read gives something else.

        It is repeated only if nothing was acknowledged: a chip is addressed before it gives its first byte.
        """
        return self._tried(lambda: self._read(register, count), NoAnswer)

    def _read(self, register: int, count: int) -> bytes:
        reply = self._bus.read(register, count)
        self.now_ns = max(self.now_ns, reply.t_ns)
        self._decoder.feed_read(register, reply.data, reply.t_ns, reply.host_ns)
        return reply.data

    def write(self, register: int, value: int) -> None:
        """Write one byte, in up to three tries."""
        self.write_block(register, bytes([value]))

    def write_block(self, register: int, data: bytes) -> None:
        """Write `data` from `register` on in one transfer, in up to three tries."""
        t_ns = self._tried(lambda: self._bus.write(register, data))
        self.now_ns = max(self.now_ns, t_ns)
        self._decoder.feed_write(register, data)

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the bus's clock shows `t_ns`."""
        self._bus.sleep_until(t_ns)
        self.now_ns = max(self.now_ns, t_ns)

    def sleep(self, ns: int) -> None:
        """Wait `ns` nanoseconds of bus time."""
        self.sleep_until(self.now_ns + ns)

    def _tried(self, access: Callable[[], T], after: type[BusError] = BusError) -> T:
        """Make an access and count it, again after errors of the kind `after`."""
        left = TRIES
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
