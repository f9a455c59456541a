"""Several buses as one, one after the other: what was recorded, then perhaps the sensor itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ..chip.access import Bus, Files, Reply
from ..chip.records import ABORT, KEY, RESUMED, Record, SessionEvent
from .replay import ReplayBus

# Between the end of one part and the begin of the next, where their clocks say nothing.
PAUSE_NS = 1_000_000_000


class ChainedBus:
    """The parts of a session that was resumed; each ends with EndOfCapture, and `go_on` begins the next.

    Parameters
    ----------
    parts : in their order; only the last one may be something else than a replay.
    """

    def __init__(self, parts: Sequence[Bus | Files]) -> None:
        self._parts = list(parts)
        self._at = 0

    @property
    def replaying(self) -> bool:
        """Whether the present part is a recorded one."""
        return isinstance(self._part, ReplayBus)

    def go_on(self) -> bool:
        """Begin the next part; False where this is the last."""
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
        """Close all of them."""
        for part in self._parts:
            part.close()

    def pending_events(self, name: str) -> list[SessionEvent]:
        """See ReplayBus; none where nothing is replayed."""
        return self._part.pending_events(name) if isinstance(self._part, ReplayBus) else []

    def unread(self) -> int:
        """How many recorded accesses of the last part nobody has asked for."""
        last = self._parts[-1]
        return last.unread() if isinstance(last, ReplayBus) else 0

    @property
    def _part(self) -> Bus | Files:
        return self._parts[self._at]


class ShiftedClockBus:
    """A bus whose clock goes on where an earlier one stopped.

    Parameters
    ----------
    bus : its first access happens a second after `last_ns`, unless its own clock shows more.
    """

    def __init__(self, bus: Bus | Files, last_ns: int) -> None:
        self._bus, self._last_ns = bus, last_ns
        self._later_ns: int | None = None

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        reply = self._bus.read(register, count)
        return reply._replace(t_ns=self._shown(reply.t_ns))

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        return self._shown(self._bus.write(register, data))

    def sleep_until(self, t_ns: int) -> None:
        """See Bus; before the first access nobody knows for how long."""
        if self._later_ns is not None:
            self._bus.sleep_until(t_ns - self._later_ns)

    def close(self) -> None:
        """See Bus."""
        self._bus.close()

    def _shown(self, t_ns: int) -> int:
        if self._later_ns is None:
            self._later_ns = max(self._last_ns + PAUSE_NS - t_ns, 0)
        return t_ns + self._later_ns


def split_at_resumes(captures: Iterable[Sequence[Record]], more: bool = False) -> list[list[Record]]:
    """The records of one or several captures, cut where a session was resumed; `more`: another part will follow.

    Of a part that somebody stopped and another follows, what came after is left out: nothing of it was measured.
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
