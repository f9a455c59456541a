"""Requests to a bridge and the replies to them: sequence numbers, timeouts, repeats, the first hello.

See firmware_protocol.md, "Sequence numbers" and "Timing".
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import cycle

from ...errors import BusError, LinkError
from .clock import BridgeClock
from .frame import DELIMITER, Deframer, Frame
from .latency import Latency
from .link_errors import flooded, no_reply, other_version, restarted
from .messages import (
    MAJOR,
    MIN_WINDOW,
    BlobBegin,
    BlobCommit,
    BlobData,
    BlobErase,
    Frames,
    Hello,
    HelloReply,
    Message,
    MessageError,
    Reply,
    Status,
    answer_of,
)
from .pending_request import Answer, PendingRequest
from .port import Chunk, Port
from .port_diagnosis import PortDiagnosis

MS = 1_000_000
# two and a half times what a bridge takes at most; the line's own latency comes on top
REPLY_NS = 250 * MS
STORE_NS = 2500 * MS
TRIES = 3
HELLO_NS = 300 * MS
GREET_NS = 5000 * MS
# what a bridge sends while one reply is on its way is a tenth of it; more is a line that is flooded
LOOK_BYTES = 1 << 18
# the first may be what a line had kept for who opens it
FLOODS = 2
# Ctrl-B: the bytes of a HELLO have led a REPL into its raw mode
NORMAL_REPL = b"\x02"

STORING = (BlobBegin, BlobData, BlobCommit, BlobErase)

Pushed = Callable[[int, Frames, int, int], None]


class LinkLost(LinkError):  # noqa: N818 - reads as the sentence it is
    """The bridge does not answer, or has forgotten that it was greeted; `greet` may bring it back."""


class Link:
    """One bridge on one port.

    Parameters
    ----------
    port : open. pushed : is told of each FRAMES: its seq, the message, its bus time and the host's [ns].

    Attributes
    ----------
    clock : the bridge's. bridge : what it said of itself; of meaning after `greet`. latency : how late replies come.
    """

    def __init__(self, port: Port, pushed: Pushed) -> None:
        self.port = port
        self.clock = BridgeClock()
        self.latency = Latency()
        self.bridge: HelloReply
        self._pushed = pushed
        self._deframer = Deframer()
        self._seq = 0
        self._window = MIN_WINDOW
        self._posted: list[PendingRequest] = []

    def greet(self, address: int = 0, within_ns: int = GREET_NS) -> HelloReply:
        """Say HELLO until the bridge answers: an Arduino's boot loader takes two seconds.

        Parameters
        ----------
        address : where its chip is; 0 lets it look.

        Raises
        ------
        BusError : nothing answers, or something that is no bridge, or one of another version.
        """
        heard, said = PortDiagnosis(), list[PendingRequest]()
        self._posted.clear()
        give_up_ns = self.port.now_ns() + within_ns
        for tried, baud in enumerate(cycle(self.port.bauds)):
            is_repl = heard.is_repl and tried >= TRIES
            if self.port.now_ns() >= give_up_ns or heard.floods == FLOODS or is_repl:
                break
            if len(self.port.bauds) > 1:
                self.port.set_baud(baud)
            reply = self._hello(address, heard, said, baud)
            if reply is not None:
                self.bridge, self._window = reply, max(MIN_WINDOW, reply.window)
                return reply
        if heard.is_repl:
            self.port.write(NORMAL_REPL)
        raise heard.why_nobody(self.port.name, self.port.bauds)

    def ask(self, *requests: Message) -> list[list[Answer]]:
        """The answers to each request, the last of which may tell that it failed; several are on their way at once.

        Raises
        ------
        LinkLost : the bridge does not answer, or was reset. BusError : the port is gone.
        """
        waiting, flying = deque(self._numbered(requests)), [one for one in self._posted if not one.done]
        asked = list(waiting)
        self._posted.clear()
        stores = any(isinstance(request, STORING) for request in requests)
        patience_ns = (STORE_NS if stores else REPLY_NS) + self.latency.most_ns
        # what must not be asked for again is waited for as long as all tries of another take
        if not all(one.repeatable for one in asked):
            patience_ns *= TRIES
        tries, deadline_ns, budget = 1, self.port.now_ns() + patience_ns, LOOK_BYTES
        while waiting or flying:
            while waiting and len(flying) < self._window:
                flying.append(waiting.popleft())
                self._send(flying[-1])
            chunk = self.port.read(deadline_ns)
            budget -= 0 if chunk is None else len(chunk.data)
            if chunk is None or not self._handle(chunk, flying):
                # by when the bytes came: a host that was busy, or asleep, has not read yet what came in time
                if chunk is not None and chunk.t_ns < deadline_ns and budget > 0:
                    continue
                if tries == TRIES or not all(one.repeatable for one in flying):
                    raise LinkLost(*(no_reply if budget > 0 else flooded)(self.port.name))
                tries += 1
                self._send(*flying, again=True)
            deadline_ns, budget = self.port.now_ns() + patience_ns, LOOK_BYTES
            flying = [one for one in flying if not one.done]
        return [one.answers for one in asked]

    def post(self, request: Message) -> PendingRequest:
        """Send a request that does no harm when carried out twice, and wait for nothing: its answer comes by and by."""
        (posted,) = self._numbered([request])
        self._send(posted)
        self._posted = [one for one in self._posted if not one.done] + [posted]
        return posted

    def remind(self, posted: PendingRequest) -> None:
        """Send what was posted again, if its answer is overdue."""
        if not posted.done and self.port.now_ns() - posted.sent_ns > REPLY_NS + self.latency.most_ns:
            self._send(posted, again=True)

    def seq_of(self, n: int) -> int:
        """The sequence number that the next request will have (n = 0), or one behind it."""
        return (self._seq + 1 + n) % 256

    def wait(self, until_ns: int) -> bool:
        """Take what is pushed until the host's clock shows `until_ns`; True as soon as something came.

        Raises
        ------
        BusError : the port is gone.
        """
        chunk = self.port.read(until_ns)
        if chunk is not None:
            self._handle(chunk, [])
        return chunk is not None

    def close(self) -> None:
        """Let go of the port."""
        self.port.close()

    def _numbered(self, requests: Sequence[Message]) -> Iterator[PendingRequest]:
        for request in requests:
            self._seq = (self._seq + 1) % 256
            yield PendingRequest(self._seq, request)

    def _send(self, *several: PendingRequest, again: bool = False) -> None:
        self.port.write(DELIMITER * again + b"".join(one.encoded() for one in several))
        for one in several:
            one.sent_ns, one.sent = self.port.now_ns(), one.sent + 1

    def _hello(self, address: int, heard: PortDiagnosis, said: list[PendingRequest], baud: int) -> HelloReply | None:
        """Say HELLO once more; the answer to any that was said, as a line may take longer than until the next."""
        said += self._numbered([Hello(address=address)])
        self._send(said[-1], again=True)
        until_ns, budget = self.port.now_ns() + HELLO_NS, LOOK_BYTES
        while (chunk := self.port.read(until_ns)) is not None:
            heard.take(chunk.data, baud)
            for frame, reply in self._messages(chunk):
                asked = next((one for one in said if one.is_answered_by(frame, reply)), None)
                if asked is None:
                    continue
                if not isinstance(reply, HelloReply) or reply.major != MAJOR:
                    raise BusError(*other_version(self.port.name, reply))
                self.clock.greeted(reply.t_us, chunk.t_ns)
                self.latency.took(chunk.t_ns - asked.sent_ns)
                return reply
            budget -= len(chunk.data)
            if chunk.t_ns >= until_ns or budget <= 0:
                heard.floods += budget <= 0
                break
        return None

    def _handle(self, chunk: Chunk, flying: Sequence[PendingRequest]) -> bool:
        """Give each message to whom it is for; whether a request was answered."""
        answered = False
        for frame, reply in self._messages(chunk):
            if isinstance(reply, Frames):
                self._pushed(frame.seq, reply, self.clock.seen(reply.t_us, chunk.t_ns), chunk.t_ns)
                continue
            for one in (*flying, *self._posted):
                if one.is_answered_by(frame, reply):
                    if reply.status == Status.NO_HELLO:
                        # its clock began anew: the time means nothing here
                        raise LinkLost(*restarted(self.port.name))
                    if one.sent == 1 and not one.answers and not isinstance(one.request, STORING):
                        self.latency.took(chunk.t_ns - one.sent_ns)
                    one.answers.append(Answer(reply, self.clock.seen(reply.t_us, chunk.t_ns), chunk.t_ns))
                    answered = answered or one in flying
        return answered

    def _messages(self, chunk: Chunk) -> Iterator[tuple[Frame, Reply]]:
        for frame in self._deframer.feed(chunk.data):
            with suppress(MessageError):
                yield frame, answer_of(frame.type, frame.payload)
