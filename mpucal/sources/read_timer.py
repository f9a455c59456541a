"""Timer of reads: a read happens between two times of the host's clock, and the process may be suspended in between."""

from __future__ import annotations

from collections.abc import Callable

from ..chip.access import Reply
from ..chip.registers import ACCEL_XOUT_H, FIFO_COUNT_H

# These are read for their time, and may be read again: a read takes nothing away from the chip.
REPEATABLE = (FIFO_COUNT_H, ACCEL_XOUT_H)
TRIES = 3
# Excess over the shortest read: two samples at 1 kHz, and more than a transfer varies by.
LATE_NS = 2_000_000


class ReadTimer:
    """Makes reads with the time just before each; a delayed one is repeated, and the shortest of the tries counts.

    Its time is early by no more than its excess over the shortest read of as many bytes.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._shortest_ns: dict[tuple[int, int], int] = {}

    def read(self, register: int, count: int, transfer: Callable[[], bytes]) -> Reply:
        """Make the read `transfer` of `count` bytes from `register` on."""
        tries = []
        for _ in range(TRIES if register in REPEATABLE else 1):
            t_ns = self._now_ns()
            data = transfer()
            took_ns = self._now_ns() - t_ns
            tries.append((took_ns, Reply(data, t_ns)))
            shortest_ns = min(took_ns, self._shortest_ns.get((register, count), took_ns))
            self._shortest_ns[register, count] = shortest_ns
            if took_ns - shortest_ns <= LATE_NS:
                break
        return min(tries, key=lambda each: each[0])[1]
