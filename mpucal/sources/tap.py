"""Bus that passes every access on to another bus, and records it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar

from ..chip.access import Bus, Failure, Reply, Transaction
from ..chip.records import Recorder
from ..errors import BusError

T = TypeVar("T")


class Tap:
    """Passes every access on to `bus` and records it in `recorder`, failed accesses included.

    A failed access has no time: it is recorded with the last known time. Both may be replaced between two accesses.
    """

    def __init__(self, bus: Bus, recorder: Recorder) -> None:
        self.bus = bus
        self.recorder = recorder
        self._latest_ns = 0

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        reply = self._tried("read", register, count, b"", lambda: self.bus.read(register, count))
        self._latest_ns = max(self._latest_ns, reply.t_ns)
        self.recorder.transaction(Transaction("read", register, count, reply.data, reply.t_ns, host_ns=reply.host_ns))
        return reply

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        t_ns = self._tried("write", register, len(data), data, lambda: self.bus.write(register, data))
        self._latest_ns = max(self._latest_ns, t_ns)
        self.recorder.transaction(Transaction("write", register, len(data), data, t_ns))
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """See Bus."""
        self.bus.sleep_until(t_ns)
        self._latest_ns = max(self._latest_ns, t_ns)

    def close(self) -> None:
        """Close the bus; the recorder stays open."""
        self.bus.close()

    def _tried(
        self, op: Literal["read", "write"], register: Any, count: int, data: bytes, access: Callable[[], T]
    ) -> T:
        """Make an access, and record a failure."""
        try:
            return access()
        except BusError as error:
            failure = Failure(type(error).__name__, error.what, error.remedy)
            self.recorder.transaction(Transaction(op, register, count, data, self._latest_ns, failure))
            raise
