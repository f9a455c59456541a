"""Chain of buses that act as one: recorded parts of a session, then perhaps the sensor itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ..chip.access import Bus, Files, Reply
from ..chip.records import ABORT, KEY, RESUMED, Record, SessionEvent
from .replay import ReplayBus

# Time between two parts whose clocks do not tell it.
PAUSE_NS = 1_000_000_000


class ChainedBus:
    """Parts of a resumed session: each ends with EndOfCapture, and `go_on` begins the next.

    Parameters
    ----------
    parts : in order; only the last one may be another bus than a replay.
    """

    def __init__(self, parts: Sequence[Bus | Files]) -> None:
        self._parts = list(parts)
        self._at = 0

    @property
    def replaying(self) -> bool:
        """True if the present part is a recorded one."""
        return isinstance(self._part, ReplayBus)

    def go_on(self) -> bool:
        """Begin the next part; return False if there is none."""
        if self._at + 1 == len(self._parts):
            return False
        self._at += 1
        return True

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        return self._part.read(register, count)

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        return self._part.write(register, data)

    def sleep_until(self, t_ns: int) -> None:
        """See Bus."""
        self._part.sleep_until(t_ns)

    def close(self) -> None:
        """Close all parts."""
        for part in self._parts:
            part.close()

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events as ReplayBus does; none from another bus."""
        return self._part.pending_events(name) if isinstance(self._part, ReplayBus) else []

    def unread(self) -> int:
        """Return the number of unread accesses in the last part."""
        last = self._parts[-1]
        return last.unread() if isinstance(last, ReplayBus) else 0

    @property
    def _part(self) -> Bus | Files:
        return self._parts[self._at]


class ShiftedClockBus:
    """Bus whose clock continues an earlier one.

    Parameters
    ----------
    bus : its first access gets a time one second after `last_ns`, unless its own clock shows more.
    """

    def __init__(self, bus: Bus | Files, last_ns: int) -> None:
        self._bus, self._last_ns = bus, last_ns
        self._shift_ns: int | None = None

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        reply = self._bus.read(register, count)
        return reply._replace(t_ns=self._shifted(reply.t_ns))

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        return self._shifted(self._bus.write(register, data))

    def sleep_until(self, t_ns: int) -> None:
        """Sleep as Bus does; at once before the first access, when the shift is unknown."""
        if self._shift_ns is not None:
            self._bus.sleep_until(t_ns - self._shift_ns)

    def close(self) -> None:
        """See Bus."""
        self._bus.close()

    def _shifted(self, t_ns: int) -> int:
        if self._shift_ns is None:
            self._shift_ns = max(self._last_ns + PAUSE_NS - t_ns, 0)
        return t_ns + self._shift_ns


def split_at_resumes(captures: Iterable[Sequence[Record]], more: bool = False) -> list[list[Record]]:
    """Split the records of one or several captures where a session was resumed; `more`: another part will follow.

    If a part was stopped by its user and another follows, the records after that are left out, which hold no samples.
    """
    parts: list[list[Record]] = []
    for records in captures:
        parts.append([])
        for record in records:
            if isinstance(record, SessionEvent) and record.name == RESUMED:
                parts += [[]] if parts[-1] else []
            else:
                parts[-1].append(record)
    last = len(parts) if more else len(parts) - 1
    return [*(_until_stopped(part) for part in parts[:last]), *parts[last:]]


def _until_stopped(part: list[Record]) -> list[Record]:
    for i, record in enumerate(part):
        if isinstance(record, SessionEvent) and record.name == KEY and record.data.get(KEY) == ABORT:
            return part[:i]
    return part
