"""Recorded parts of a session, then perhaps the sensor or vehicle itself, that act as one bus or transport."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..chip.access import ABORT, KEY, RESUMED, SessionEvent
from ..clocks import S

if TYPE_CHECKING:
    from ..files.mcap import Record


Item = TypeVar("Item")


class RecordedParts(ABC, Generic[Item]):
    """Items (accesses or packets) of a session in their order, with the session events among them.

    Each part ends with EndOfCapture, and `open_next_part` opens the next. A replay that calls `pending_events` where
    the session read its keyboard gets each event in its place.

    Parameters
    ----------
    records : of the first part. name : of the capture. later : records of the further parts.
    live : bus or transport of the sensor or vehicle, which is the last part; its clock begins a second after the last
        record, unless it shows more.

    Attributes
    ----------
    replaying : True while the present part is a recorded one. resumes : True if the last part is not.
    """

    def __init__(
        self,
        records: Iterable[Record],
        name: str = "the capture",
        later: Iterable[Sequence[Record]] = (),
        live: Any = None,
    ) -> None:
        self.name, self.replaying, self.resumes = name, True, live is not None
        self._later, self._live, self._last_ns = deque(later), live, 0
        self._shift_ns: int | None = None
        self._load(records)

    def _load(self, records: Iterable[Record]) -> None:
        """Begin a recorded part."""
        self._items: deque[Any] = deque()
        # Events before each item, and after the last.
        self._events: deque[list[SessionEvent]] = deque([[]])
        for record in records:
            self._last_ns = max(self._last_ns, record.t_ns)
            if isinstance(record, SessionEvent):
                self._events[-1].append(record)
            elif self._is_item(record):
                self._items.append(record)
                self._events.append([])
        self._pending = self._events.popleft()

    @property
    def is_last(self) -> bool:
        """True if no part follows."""
        return not self._later and self.resumes is not self.replaying

    def open_next_part(self) -> bool:
        """Open the next part; return False if there is none."""
        if self.is_last:
            return False
        if self._later:
            self._load(self._later.popleft())
        else:
            self.replaying, self._pending = False, []
        return True

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events of that name recorded before the next item, each once."""
        pending = [event for event in self._pending if event.name == name and self._is_due(event)]
        self._pending = [event for event in self._pending if event not in pending]
        return pending

    def unread(self) -> int:
        """Return the number of items that the replay has not read; 0 for a session that is resumed."""
        later = sum(self._is_item(record) for part in self._later for record in part)
        return 0 if self.resumes else len(self._items) + later

    def close(self) -> None:
        """Close the sensor's bus or the vehicle's transport."""
        if self.resumes:
            self._live.close()

    @abstractmethod
    def _is_item(self, record: Record) -> bool: ...

    def _take(self) -> Item:
        self._pending += self._events.popleft()
        item: Item = self._items.popleft()
        return item

    def _is_due(self, _event: SessionEvent) -> bool:
        return True

    def _begin_clock(self, now_ns: int) -> int:
        """Join the clock of the sensor or vehicle, which shows `now_ns`, to the session's; return the shift."""
        self._shift_ns = max(self._last_ns + S - now_ns, 0)
        return self._shift_ns

    def _shifted(self, t_ns: int) -> int:
        """Convert a time of the sensor's or vehicle's clock to the session's; the first one begins it."""
        return t_ns + (self._begin_clock(t_ns) if self._shift_ns is None else self._shift_ns)


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
