"""Bus that records every access on another bus, and a bus that answers from the records alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal, TypeVar

from ..chip.access import Bus, Failure, Reply, Transaction
from ..chip.records import Recorder, SessionEvent
from ..errors import BusError, BusHeld, CaptureError, EndOfCapture, LateRead, LinkError, NoAnswer
from ..files.mcap import Record

_RAISES: dict[str, type[BusError]] = {kind.__name__: kind for kind in (NoAnswer, BusHeld, LateRead, LinkError)}
_RAISES["LinkLost"] = LinkError


class ReplayBus:
    """Bus that answers the recorded accesses, in their order, with the recorded replies.

    It raises EndOfCapture after the last one, CaptureError on another access than the recorded one, and the recorded
    error of an access that failed.

    Parameters
    ----------
    records : as recorded. name : of the capture, for messages.
    """

    def __init__(self, records: Iterable[Record], name: str = "the capture") -> None:
        self._name = name
        self._accesses: list[Transaction] = []
        # Events before each access, and after the last.
        self._events: list[list[SessionEvent]] = [[]]
        for record in records:
            if isinstance(record, SessionEvent):
                self._events[-1].append(record)
            elif isinstance(record, Transaction):
                self._accesses.append(record)
                self._events.append([])
        self._next = 0
        self._pending = list(self._events[0])

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        recorded = self._next_recorded(Transaction("read", register, count, b"", 0))
        return Reply(recorded.data, recorded.t_ns, recorded.host_ns)

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        return self._next_recorded(Transaction("write", register, len(data), data, 0)).t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Return at once: the replies carry their times."""

    def close(self) -> None:
        """Do nothing; `unread` shows if the whole capture was used."""

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events of that name recorded before the next access, each once.

        A replay that calls it where the session read its keyboard gets each event between the same two accesses.
        """
        pending = [event for event in self._pending if event.name == name]
        self._pending = [event for event in self._pending if event.name != name]
        return pending

    def unread(self) -> int:
        """Return the number of unread accesses."""
        return len(self._accesses) - self._next

    def _next_recorded(self, asked: Transaction) -> Transaction:
        if self._next == len(self._accesses):
            raise EndOfCapture(f"{self._name} ends before {_words(asked)}")
        recorded = as_asked(asked, self._accesses[self._next], f"access {self._next} of {self._name}")
        self._next += 1
        self._pending += self._events[self._next]
        return successful(recorded)


def as_asked(asked: Transaction, recorded: Transaction, which: str) -> Transaction:
    """Return a recorded access; CaptureError if the program asked for another one."""
    if _words(asked) != _words(recorded):
        raise CaptureError(
            f"the program makes {_words(asked)}, but {which} is {_words(recorded)}",
            "replay it with the mpucal and options that recorded it, or calibrate it without replaying",
        )
    return recorded


def successful(recorded: Transaction) -> Transaction:
    """Return a recorded access, or raise its error."""
    if recorded.error is not None:
        raise _RAISES.get(recorded.error.name, BusError)(recorded.error.what, recorded.error.remedy)
    return recorded


def _words(access: Transaction) -> str:
    """Describe an access; equal descriptions mean equal accesses."""
    if access.op == "read":
        return f"a read of {access.count} bytes from {_place(access)}"
    return f"a write of {access.data.hex(' ') or 'nothing'} to {_place(access)}"


def _place(access: Transaction) -> str:
    return access.register if isinstance(access.register, str) else f"0x{access.register:02x}"


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
