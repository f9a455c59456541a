"""Parts of a session that act as one: recorded ones, then perhaps the sensor or vehicle itself."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..chip.access import Bus, Reply
from ..chip.records import ABORT, KEY, RESUMED, SessionEvent
from ..mavlink.transport import ReceivedBytes, Transport

if TYPE_CHECKING:
    from ..files.mcap import Record

# Time between two parts whose clocks do not tell it.
PAUSE_NS = 1_000_000_000

Part = TypeVar("Part", bound=Bus | Transport)
Item = TypeVar("Item")


class RecordedPart(Generic[Item]):
    """Recorded part of a session: its accesses or packets in their order, and the session events among them.

    A replay that calls `pending_events` where the session read its keyboard gets each event in its place.

    Parameters
    ----------
    is_item : returns True for its accesses or packets. records : as recorded. name : of the capture.
    """

    def __init__(self, is_item: Callable[[Record], bool], records: Iterable[Record], name: str) -> None:
        self.name = name
        self._items: deque[Any] = deque()
        # Events before each item, and after the last.
        self._events: deque[list[SessionEvent]] = deque([[]])
        for record in records:
            if isinstance(record, SessionEvent):
                self._events[-1].append(record)
            elif is_item(record):
                self._items.append(record)
                self._events.append([])
        self._pending = self._events.popleft()

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events of that name recorded before the next item, each once."""
        pending = [event for event in self._pending if event.name == name and self._is_due(event)]
        self._pending = [event for event in self._pending if event not in pending]
        return pending

    def unread(self) -> int:
        """Return the number of unread accesses."""
        return len(self._items)

    def close(self) -> None:
        """Do nothing: no device is open."""

    def _take(self) -> Item:
        self._pending += self._events.popleft()
        item: Item = self._items.popleft()
        return item

    def _is_due(self, _event: SessionEvent) -> bool:
        return True


class Chain(Generic[Part]):
    """Parts of a session: each ends with EndOfCapture, and `go_on` begins the next.

    Parameters
    ----------
    parts : in order; only the last one may be another than a recorded one.
    last_ns : time of the last record: the clock of the last part begins a second later, unless it shows more.

    Attributes
    ----------
    resumes : True if the last part is not a recorded one.
    """

    def __init__(self, parts: Sequence[Part], last_ns: int = 0) -> None:
        self._parts, self._last_ns = list(parts), last_ns
        self.resumes = not isinstance(self._parts[-1], RecordedPart)
        self._at = 0
        # Of the last part's clock, if it is not a recorded one and its time is known.
        self._shift_ns: int | None = None

    @property
    def replaying(self) -> bool:
        """True if the present part is a recorded one."""
        return not (self.resumes and self.is_last)

    @property
    def is_last(self) -> bool:
        """True if no part follows."""
        return self._at + 1 == len(self._parts)

    def go_on(self) -> bool:
        """Begin the next part; return False if there is none."""
        if self.is_last:
            return False
        self._at += 1
        return True

    def close(self) -> None:
        """Close all parts."""
        for part in self._parts:
            part.close()

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events as a recorded part does; none from another."""
        part: Any = self._part
        return part.pending_events(name) if self.replaying else []

    def unread(self) -> int:
        """Return the number of unread accesses in the last part."""
        last = self._parts[-1]
        return last.unread() if isinstance(last, RecordedPart) else 0

    @property
    def _part(self) -> Part:
        return self._parts[self._at]

    def _begin_clock(self, now_ns: int) -> None:
        """Let the clock of a part that is not a recorded one, which shows `now_ns`, continue the session's."""
        if self._shift_ns is None and not self.replaying:
            self._shift_ns = max(self._last_ns + PAUSE_NS - now_ns, 0)


class ChainedBus(Chain[Bus]):
    """Parts of a session with a chip or a driver of the kernel."""

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        reply = self._part.read(register, count)
        return reply._replace(t_ns=self._shifted(reply.t_ns))

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        return self._shifted(self._part.write(register, data))

    def _shifted(self, t_ns: int) -> int:
        # A bus shows its time only in its replies: the first one begins the clock.
        self._begin_clock(t_ns)
        return t_ns + (self._shift_ns or 0)

    def sleep_until(self, t_ns: int) -> None:
        """Sleep as Bus does; at once in a replay, and before the first access after it, when the shift is unknown."""
        if self._shift_ns is not None:
            self._part.sleep_until(t_ns - self._shift_ns)


class ChainedTransport(Chain[Transport]):
    """Parts of a session with a vehicle."""

    def __init__(self, parts: Sequence[Transport], last_ns: int) -> None:
        super().__init__(parts, last_ns)
        self._begin_part()

    def go_on(self) -> bool:
        """See Chain."""
        went_on = super().go_on()
        self._begin_part()
        return went_on

    def now_ns(self) -> int:
        """See Transport."""
        return self._part.now_ns() + (self._shift_ns or 0)

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        shift_ns = self._shift_ns or 0
        received = self._part.receive(until_ns - shift_ns)
        return None if received is None else received._replace(t_ns=received.t_ns + shift_ns)

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        self._part.send(data, address)

    def restrict(self, address: str | None) -> None:
        """See Transport."""
        self._part.restrict(address)

    def _begin_part(self) -> None:
        self._begin_clock(self._part.now_ns())
        self.name, self.datagrams, self.outward = self._part.name, self._part.datagrams, self._part.outward


def split_at_resumes(captures: Iterable[Sequence[Record]], more: bool = False) -> list[list[Record]]:
    """Split the records of one or several captures where a session was resumed; `more`: another part will follow.

    If a part was stopped by its user and another follows, the records after that are left out, which hold no samples.
    """
    parts: list[list[Record]] = []
    for records in captures:
        parts.append([])
        for record in records:
            if isinstance(record, SessionEvent) and record.name == RESUMED and parts[-1]:
                parts.append([])
            parts[-1].append(record)
    last = len(parts) if more else len(parts) - 1
    return [*(_until_stopped(part) for part in parts[:last]), *parts[last:]]


def _until_stopped(part: list[Record]) -> list[Record]:
    for i, record in enumerate(part):
        if isinstance(record, SessionEvent) and record.name == KEY and record.data.get(KEY) == ABORT:
            return part[:i]
    return part
