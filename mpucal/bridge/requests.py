"""Requests that were sent to a bridge, the answers that came for them, and how long these take."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from ..chip.registers import FIFO_R_W, INT_STATUS
from .frame import Frame
from .messages import REPLY_BIT, BlobRead, BlobReadReply, Burst, BurstReply, Message, Read, ReadReply, Reply, Status

# A line with a larger latency cannot carry a session.
LONGEST_NS = 3_000_000_000


class Answer(NamedTuple):
    """Reply with its bus time and the host's time of its arrival."""

    reply: Reply
    t_ns: int
    host_ns: int


@dataclass
class PendingRequest:
    """Request on its way.

    Attributes
    ----------
    answers : replies so far. sent_ns : host's time when it was sent last. sent : number of times it was sent.
    """

    seq: int
    request: Message
    answers: list[Answer] = field(default_factory=list)
    sent_ns: int = 0
    sent: int = 0

    @property
    def done(self) -> bool:
        """True if the whole answer has come."""
        if not self.answers:
            return False
        last = self.answers[-1].reply
        if last.status != Status.OK or not isinstance(last, BurstReply) or not isinstance(self.request, Burst):
            return True
        return last.offset + len(last.data) >= self.request.count

    @property
    def repeatable(self) -> bool:
        """True if it may be carried out twice; a read of the FIFO or of INT_STATUS may not, since it changes them."""
        if isinstance(self.request, Burst):
            return False
        if not isinstance(self.request, Read):
            return True
        first = self.request.register
        return not first <= INT_STATUS < first + self.request.count and first != FIFO_R_W

    def is_answered_by(self, frame: Frame, reply: Reply) -> bool:
        """Return True if `reply` answers it with the right number of bytes; to a BURST, with the next part."""
        if self.done or (frame.seq, frame.type) != (self.seq, self.request.TYPE | REPLY_BIT):
            return False
        if isinstance(reply, ReadReply | BlobReadReply) and isinstance(self.request, Read | BlobRead):
            return reply.status != Status.OK or len(reply.data) == self.request.count
        if not isinstance(reply, BurstReply) or not isinstance(self.request, Burst):
            return True
        held = sum(len(a.reply.data) for a in self.answers if isinstance(a.reply, BurstReply))
        return reply.offset == held and held + len(reply.data) <= self.request.count

    def encoded(self) -> bytes:
        """Return its bytes on the line."""
        return Frame(self.request.TYPE, self.seq, self.request.payload()).encode()


class Latency:
    """Smoothed round-trip time of requests (RFC 6298, 2.3): radio, networks and busy hosts delay replies."""

    def __init__(self) -> None:
        self._mean_ns: float | None = None
        self._deviation_ns = 0.0

    def add(self, ns: int) -> None:
        """Add the round-trip time of a request that was sent once."""
        if self._mean_ns is None:
            self._mean_ns, self._deviation_ns = ns, ns / 2
            return
        self._deviation_ns += (abs(ns - self._mean_ns) - self._deviation_ns) / 4
        self._mean_ns += (ns - self._mean_ns) / 8

    @property
    def most_ns(self) -> int:
        """Longest round-trip time to expect; 0 before the first reply."""
        return min(LONGEST_NS, round((self._mean_ns or 0.0) + 4 * self._deviation_ns))
