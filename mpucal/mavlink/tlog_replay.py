"""Replay of a .tlog in place of a vehicle: the packets come again at their times, and nothing is sent."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

from ..errors import EndOfCapture
from .dialect import Parser, dialect
from .session_events import Note, NoteReader, is_own
from .tlog import Tlog
from .transport import PAUSE_NS, ReceivedBytes


class TimedNote(NamedTuple):
    """A note, and when it was made [ns since 1970]."""

    t_ns: int
    note: Note


class TlogReplay:
    """Transport of the recorded packets, which keeps the notes among them for `pending`.

    The packets that mpucal itself sent are skipped.
    """

    datagrams, outward = True, False

    def __init__(self, tlog: Tlog) -> None:
        self.name = tlog.name
        self._records = tlog.records
        # Times of all packets: our own heartbeats show that a vehicle was silent, and the program was not suspended.
        self._times_ns = [record.t_ns for record in tlog.records]
        self._parser = Parser(dialect().MAVLink(None))
        self._notes = NoteReader()
        self._pending: list[TimedNote] = []
        self._at = 0
        self._now_ns = tlog.records[0].t_ns
        self._end_ns = tlog.records[-1].t_ns
        self._skip_own()

    def now_ns(self) -> int:
        """See Transport."""
        return self._now_ns

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport.

        Raises
        ------
        EndOfCapture : there are no more packets.
        """
        ended = self._at == len(self._records)
        if ended and until_ns > self._end_ns:
            raise EndOfCapture(f"{self.name} ends")
        if ended or self._records[self._at].t_ns >= until_ns:
            at = bisect_left(self._times_ns, until_ns)
            next_ns = self._times_ns[at] if at < len(self._times_ns) else until_ns
            self._now_ns = max(self._now_ns, next_ns if next_ns - until_ns > PAUSE_NS else until_ns)
            return None
        record = self._records[self._at]
        t_ns = max(record.t_ns, self._now_ns)
        self._now_ns = t_ns
        self._at += 1
        self._skip_own()
        return ReceivedBytes(record.data, self.name, t_ns)

    def send(self, data: bytes, address: str | None) -> None:
        """Do nothing: no vehicle is there."""

    def restrict(self, address: str | None) -> None:
        """See Transport."""

    def close(self) -> None:
        """Do nothing: no file is open."""

    def pending(self, name: str) -> Sequence[TimedNote]:
        """Return the notes of that name made until now that stand before the next packet, each once."""

        def is_due(noted: TimedNote) -> bool:
            return noted.t_ns <= self._now_ns and noted.note.name == name

        pending, self._pending = self._pending, [noted for noted in self._pending if not is_due(noted)]
        return [noted for noted in pending if is_due(noted)]

    def _skip_own(self) -> None:
        """Move on to the next packet that is not mpucal's."""
        while self._at < len(self._records):
            record = self._records[self._at]
            packets = self._parser.datagram(record.data)
            if not packets or not all(is_own(packet.message) for packet in packets):
                return
            self._at += 1
            for packet in packets:
                note = self._notes.add(packet.message)
                if note is not None:
                    self._pending.append(TimedNote(record.t_ns, note))
