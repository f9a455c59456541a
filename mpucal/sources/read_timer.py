"""When a read happened: between the host's clock before and after it, within which a process may be put to sleep."""

from __future__ import annotations

from collections.abc import Callable

from ..chip.access import Reply
from ..chip.registers import ACCEL_XOUT_H, FIFO_COUNT_H

# what is read for its time, and may be read again: nothing is taken away from the chip
AGAIN = (FIFO_COUNT_H, ACCEL_XOUT_H)
TRIES = 3
# longer than the shortest of its like: two samples at 1 kHz, and more than a transfer varies by
LATE_NS = 2_000_000


class ReadTimer:
    """Reads with the time just before each; one that was held up is repeated, and of all tries the shortest counts.

    Its time is early by no more than it took longer than the shortest read of as many bytes.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._shortest_ns: dict[tuple[int, int], int] = {}

    def read(self, register: int, count: int, transfer: Callable[[], bytes]) -> Reply:
        """What `transfer` gives, which reads `count` bytes from `register` on."""
        found = []
        for _ in range(TRIES if register in AGAIN else 1):
            t_ns = self._now_ns()
            data = transfer()
            took_ns = self._now_ns() - t_ns
            found.append((took_ns, Reply(data, t_ns)))
            shortest_ns = min(took_ns, self._shortest_ns.get((register, count), took_ns))
            self._shortest_ns[register, count] = shortest_ns
            if took_ns - shortest_ns <= LATE_NS:
                break
        return min(found, key=lambda each: each[0])[1]
