"""Timer of reads: a read happens between two times of the host's clock, and the process may be suspended in between."""

from __future__ import annotations

from collections.abc import Callable

from ..chip.access import Reply
from ..chip.registers import ACCEL_XOUT_H, FIFO_COUNT_H
from ..chip.transfer_stats import LATE_REMEDY
from ..errors import LateRead

TRIES = 3
# Excess over the shortest read: two samples at 1 kHz, and more than a transfer varies by.
LATE_NS = 2_000_000
# Attributes of a kernel driver that are samples end so.
RAW = "_raw"


class ReadTimer:
    """Makes reads with the time just before each, and repeats a delayed one whose time matters.

    The time of a sample or of a count of samples is early by at most LATE_NS more than that of the shortest read of as
    many bytes.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._shortest_ns: dict[tuple[int | str, int], int] = {}

    def read(self, register: int | str, count: int, transfer: Callable[[], bytes]) -> Reply:
        """Make the read `transfer` of `count` bytes from `register` on, or of the file of this name.

        Raises
        ------
        LateRead : the time matters, and all tries were delayed.
        """
        for _ in range(TRIES):
            t_ns = self._now_ns()
            data = transfer()
            took_ns = self._now_ns() - t_ns
            shortest_ns = min(took_ns, self._shortest_ns.get((register, count), took_ns))
            self._shortest_ns[register, count] = shortest_ns
            if took_ns - shortest_ns <= LATE_NS or not _is_timed(register, count):
                return Reply(data, t_ns)
        raise LateRead(
            f"a read took {(took_ns - shortest_ns) / 1e6:.0f} ms longer than usual, so that its time is not known",
            LATE_REMEDY,
        )


def _is_timed(register: int | str, count: int) -> bool:
    """Return True if the time of the read is that of samples; then it may be repeated, too."""
    if isinstance(register, str):
        return register.endswith(RAW)
    return register == FIFO_COUNT_H or register <= ACCEL_XOUT_H < register + count
