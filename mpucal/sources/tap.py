"""A bus that passes every access on to another bus, and records it."""

from __future__ import annotations

from typing import Any

from ..chip.access import Bus, Failure, Files, Reply, Transaction
from ..chip.records import Recorder
from ..errors import BusError


class Tap:
    """Passes every access on to `bus` and tells `recorder`, failed accesses too.

    A failed access has no time of its own: it is recorded with the latest time that is known.
    """

    def __init__(self, bus: Bus | Files, recorder: Recorder) -> None:
        self._bus = bus
        self._recorder = recorder
        self._latest_ns = 0

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        try:
            reply = self._bus.read(register, count)
        except BusError as error:
            self._recorder.transaction(Transaction("read", register, count, b"", self._latest_ns, _failure(error)))
            raise
        self._latest_ns = max(self._latest_ns, reply.t_ns)
        self._recorder.transaction(Transaction("read", register, count, reply.data, reply.t_ns, host_ns=reply.host_ns))
        return reply

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        try:
            t_ns = self._bus.write(register, data)
        except BusError as error:
            self._recorder.transaction(
                Transaction("write", register, len(data), data, self._latest_ns, _failure(error))
            )
            raise
        self._latest_ns = max(self._latest_ns, t_ns)
        self._recorder.transaction(Transaction("write", register, len(data), data, t_ns))
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """See Bus."""
        self._bus.sleep_until(t_ns)
        self._latest_ns = max(self._latest_ns, t_ns)

    def close(self) -> None:
        """Close the bus; the recorder stays open."""
        self._bus.close()


def _failure(error: BusError) -> Failure:
    return Failure(type(error).__name__, error.what, error.remedy)
