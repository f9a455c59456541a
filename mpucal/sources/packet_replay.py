"""Replay of a vehicle's capture in place of a transport: the packets come again at their times, and nothing is sent."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence

from ..chip.records import SessionEvent
from ..errors import EndOfCapture
from ..files.mcap import Record
from ..mavlink.texts import is_own
from ..mavlink.tlog import RawPacket
from ..mavlink.transport import PAUSE_NS, ReceivedBytes


class PacketReplay:
    """Transport of the recorded packets, which keeps the session events among them for `pending_events`.

    The packets that mpucal itself sent are skipped.

    Parameters
    ----------
    records : as recorded. name : of the capture, for messages.
    """

    datagrams, outward = True, False

    def __init__(self, records: Sequence[Record], name: str) -> None:
        self.name = name
        # Times of all records: our own heartbeats show that a vehicle was silent, and the program was not suspended.
        self._times_ns = [record.t_ns for record in records]
        self._now_ns, self._end_ns = (self._times_ns[0], self._times_ns[-1]) if records else (0, 0)
        self._packets: deque[RawPacket] = deque()
        # Events before each packet, and after the last.
        self._events: deque[list[SessionEvent]] = deque([[]])
        for record in records:
            if isinstance(record, SessionEvent):
                self._events[-1].append(record)
            elif isinstance(record, RawPacket) and not is_own(record.data):
                self._packets.append(record)
                self._events.append([])
        self._pending = self._events.popleft()

    def now_ns(self) -> int:
        """See Transport."""
        return self._now_ns

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport.

        Raises
        ------
        EndOfCapture : there are no more packets.
        """
        if not self._packets and until_ns > self._end_ns:
            raise EndOfCapture(f"{self.name} ends")
        if not self._packets or self._packets[0].t_ns >= until_ns:
            at = bisect_left(self._times_ns, until_ns)
            next_ns = self._times_ns[at] if at < len(self._times_ns) else until_ns
            self._now_ns = max(self._now_ns, next_ns if next_ns - until_ns > PAUSE_NS else until_ns)
            return None
        packet = self._packets.popleft()
        self._now_ns = max(packet.t_ns, self._now_ns)
        self._pending += self._events.popleft()
        return ReceivedBytes(packet.data, self.name, self._now_ns)

    def send(self, data: bytes, address: str | None) -> None:
        """Do nothing: no vehicle is there."""

    def restrict(self, address: str | None) -> None:
        """See Transport."""

    def close(self) -> None:
        """Do nothing: no file is open."""

    def pending_events(self, name: str) -> list[SessionEvent]:
        """Return the events of that name made until now that stand before the next packet, each once."""

        def is_due(event: SessionEvent) -> bool:
            return event.name == name and event.t_ns <= self._now_ns

        pending, self._pending = self._pending, [event for event in self._pending if not is_due(event)]
        return [event for event in pending if is_due(event)]

    def unread(self) -> int:
        """Return 0: what a vehicle sends does not depend on what is read."""
        return 0
