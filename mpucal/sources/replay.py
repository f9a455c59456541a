"""Recorder of the accesses on a bus, and recorded parts of a session that take the place of a bus or a transport."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable
from typing import Any, Literal, TypeVar

from ..chip.access import Bus, Failure, Reply, SessionEvent, Transaction
from ..errors import BusError, BusHeld, CaptureError, EndOfCapture, LateRead, LinkError, NoAnswer
from ..files.mcap import Record
from ..mavlink.texts import is_own
from ..mavlink.tlog import RawPacket
from ..mavlink.transports import PAUSE_NS, ReceivedBytes
from .recorded_parts import RecordedParts

_RAISES: dict[str, type[BusError]] = {kind.__name__: kind for kind in (NoAnswer, BusHeld, LateRead, LinkError)}
_RAISES["LinkLost"] = LinkError


class ReplayBus(RecordedParts[Transaction]):
    """Bus that answers the recorded accesses, in their order, with the recorded replies; see RecordedParts.

    It raises EndOfCapture after the last one, CaptureError on another access than the recorded one, and the recorded
    error of an access that failed.
    """

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        if not self.replaying:
            reply: Reply = self._live.read(register, count)
            return reply._replace(t_ns=self._shifted(reply.t_ns))
        recorded = self._next_recorded(Transaction("read", register, count, b"", 0))
        return Reply(recorded.data, recorded.t_ns, recorded.host_ns)

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        if not self.replaying:
            return self._shifted(self._live.write(register, data))
        return self._next_recorded(Transaction("write", register, len(data), data, 0)).t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep as Bus does; not in a replay, whose replies carry their times, nor before the first reply after it."""
        if self._shift_ns is not None:
            self._live.sleep_until(t_ns - self._shift_ns)

    def _is_item(self, record: Record) -> bool:
        return isinstance(record, Transaction)

    def _load(self, records: Iterable[Record]) -> None:
        super()._load(records)
        self._count = len(self._items)

    def _next_recorded(self, asked: Transaction) -> Transaction:
        if not self._items:
            raise EndOfCapture(f"{self.name} ends before {_words(asked)}")
        as_asked(asked, self._items[0], f"access {self._count - len(self._items)} of {self.name}")
        return successful(self._take())


class PacketReplay(RecordedParts[RawPacket]):
    """Transport of recorded packets, which come again at their times; those that mpucal itself sent are skipped."""

    datagrams, outward = True, False

    def open_next_part(self) -> bool:
        """See RecordedParts."""
        opened = super().open_next_part()
        if not self.replaying:
            self.name, self.datagrams, self.outward = self._live.name, self._live.datagrams, self._live.outward
            self._begin_clock(self._live.now_ns())
        return opened

    def _is_item(self, record: Record) -> bool:
        return isinstance(record, RawPacket) and not is_own(record.data)

    def _load(self, records: Iterable[Record]) -> None:
        records = list(records)
        super()._load(records)
        # Times of all records: our own heartbeats show that a vehicle was silent, and the program was not suspended.
        self._times_ns = [record.t_ns for record in records] or [0]
        self._now_ns = self._times_ns[0]

    def now_ns(self) -> int:
        """See Transport."""
        return self._now_ns if self.replaying else self._shifted(self._live.now_ns())

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport.

        Raises
        ------
        EndOfCapture : there are no more packets.
        """
        if not self.replaying:
            received: ReceivedBytes | None = self._live.receive(until_ns - (self._shift_ns or 0))
            return None if received is None else received._replace(t_ns=self._shifted(received.t_ns))
        if not self._items and until_ns > self._times_ns[-1]:
            raise EndOfCapture(f"{self.name} ends")
        if not self._items or self._items[0].t_ns >= until_ns:
            at = bisect_left(self._times_ns, until_ns)
            next_ns = self._times_ns[at] if at < len(self._times_ns) else until_ns
            self._now_ns = max(self._now_ns, next_ns if next_ns - until_ns > PAUSE_NS else until_ns)
            return None
        packet = self._take()
        self._now_ns = max(packet.t_ns, self._now_ns)
        return ReceivedBytes(packet.data, self.name, self._now_ns)

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport; in a replay no vehicle is there."""
        if not self.replaying:
            self._live.send(data, address)

    def restrict(self, address: str | None) -> None:
        """See Transport."""
        if not self.replaying:
            self._live.restrict(address)

    def unread(self) -> int:
        """Return 0: a vehicle sends its packets whether they are read or not."""
        return 0

    def _is_due(self, event: SessionEvent) -> bool:
        return event.t_ns <= self._now_ns


def as_asked(asked: Transaction, recorded: Transaction, which: str) -> Transaction:
    """Return a recorded access; CaptureError if the program makes another one."""
    if _words(asked) != _words(recorded):
        raise CaptureError(
            f"the program makes {_words(asked)}, but {which} is {_words(recorded)}",
            "replay it with the command, mpucal and options that recorded it, or give it without --replay to"
            " `calibrate`, `check` or `noise`",
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
    """Passes every access on to `bus` and to `record`, failed accesses included.

    A failed access has no time: it is recorded with the last known time. Both may be replaced between two accesses.
    """

    def __init__(self, bus: Bus, record: Callable[[Transaction], object]) -> None:
        self.bus, self.record = bus, record
        self._latest_ns = 0

    def read(self, register: Any, count: int) -> Reply:
        """See Bus."""
        reply = self._tried("read", register, count, b"", lambda: self.bus.read(register, count))
        self._latest_ns = max(self._latest_ns, reply.t_ns)
        self.record(Transaction("read", register, count, reply.data, reply.t_ns, host_ns=reply.host_ns))
        return reply

    def write(self, register: Any, data: bytes) -> int:
        """See Bus."""
        t_ns = self._tried("write", register, len(data), data, lambda: self.bus.write(register, data))
        self._latest_ns = max(self._latest_ns, t_ns)
        self.record(Transaction("write", register, len(data), data, t_ns))
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """See Bus."""
        self.bus.sleep_until(t_ns)
        self._latest_ns = max(self._latest_ns, t_ns)

    def close(self) -> None:
        """Close the bus."""
        self.bus.close()

    def _tried(
        self, op: Literal["read", "write"], register: Any, count: int, data: bytes, access: Callable[[], T]
    ) -> T:
        """Make an access, and record a failure."""
        try:
            return access()
        except BusError as error:
            failure = Failure(type(error).__name__, error.what, error.remedy)
            self.record(Transaction(op, register, count, data, self._latest_ns, failure))
            raise
