"""Requests to a bridge and their replies: sequence numbers, time-outs, repeats, and the greeting.

See firmware_protocol.md, "Sequence numbers" and "Timing".
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import cycle

from ..chip.port import TRIES
from ..clocks import MS
from ..clocks.device_clocks import BridgeClock
from ..errors import BusError, LinkError
from . import messages as wire
from .frame import DELIMITER, Deframer, Frame
from .port import Chunk, Port
from .port_errors import PortDiagnosis, flooded, no_reply
from .requests import Answer, Latency, PendingRequest

# Two and a half times what a bridge needs at most; the line's own latency is added.
REPLY_NS = 250 * MS
STORE_NS = 2500 * MS
GREET_NS = 5000 * MS
# A bridge sends a tenth of this while one reply is on its way; a line with more is flooded.
FLOOD_BYTES = 1 << 18
# The first flood may be what a line had stored before it was opened.
FLOODS = 2
# Ctrl-B leaves the raw mode of a REPL, which the bytes of a HELLO enter.
NORMAL_REPL = b"\x02"

STORING = (wire.BlobBegin, wire.BlobData, wire.BlobCommit, wire.BlobErase)

OnFrames = Callable[[int, wire.Frames, int, int], None]


class LinkLost(LinkError):  # noqa: N818 - reads as the sentence it is
    """The bridge does not answer, or was reset and forgot the greeting; `greet` may bring it back."""


class Link:
    """Link to the bridge on a port.

    Parameters
    ----------
    port : open. on_frames : called for each FRAMES with its seq, the message, its bus time and the host's time [ns].

    Attributes
    ----------
    clock, latency : of the bridge. bridge : its reply to HELLO, once it was greeted.
    """

    def __init__(self, port: Port, on_frames: OnFrames = lambda _seq, _frames, _t_ns, _host_ns: None) -> None:
        self.port = port
        self.clock = BridgeClock()
        self.latency = Latency()
        self.bridge: wire.HelloReply
        self._on_frames = on_frames
        self._deframer = Deframer()
        self._seq = 0
        self._window = wire.MIN_WINDOW
        self._posted: list[PendingRequest] = []

    def greet(self, address: int = 0, within_ns: int = GREET_NS) -> wire.HelloReply:
        """Send HELLO until the bridge answers: an Arduino's boot loader takes two seconds.

        Parameters
        ----------
        address : of its chip; 0 lets it search.

        Raises
        ------
        BusError : nothing answers, or something that is not a bridge, or a bridge of another version.
        """
        diagnosis, greetings = PortDiagnosis(), list[PendingRequest]()
        self._posted.clear()
        give_up_ns = self.port.now_ns() + within_ns
        for tried, baud in enumerate(cycle(self.port.bauds)):
            is_repl = diagnosis.is_repl and tried >= TRIES
            if self.port.now_ns() >= give_up_ns or diagnosis.floods == FLOODS or is_repl:
                break
            if len(self.port.bauds) > 1:
                self.port.set_baud(baud)
            reply = self._hello(address, diagnosis, greetings, baud)
            if reply is not None:
                self.bridge, self._window = reply, max(wire.MIN_WINDOW, reply.window)
                return reply
        if diagnosis.is_repl:
            self.port.write(NORMAL_REPL)
        raise diagnosis.error(self.port.name, self.port.bauds)

    def ask(self, *requests: wire.Message) -> list[list[Answer]]:
        """Send requests, several at once, and return the answers to each; the last of these may be a failure.

        Raises
        ------
        LinkLost : the bridge does not answer, or was reset. BusError : the port is gone.
        """
        waiting, flying = deque(self._numbered(requests)), [each for each in self._posted if not each.done]
        asked = list(waiting)
        self._posted.clear()
        stores = any(isinstance(request, STORING) for request in requests)
        patience_ns = (STORE_NS if stores else REPLY_NS) + self.latency.most_ns
        # A request that must not be repeated gets the time that all tries of another take.
        if not all(each.repeatable for each in asked):
            patience_ns *= TRIES
        tries, deadline_ns, budget = 1, self.port.now_ns() + patience_ns, FLOOD_BYTES
        while waiting or flying:
            while waiting and len(flying) < self._window:
                flying.append(waiting.popleft())
                self._send(flying[-1])
            chunk = self.port.read(deadline_ns)
            budget -= 0 if chunk is None else len(chunk.data)
            if chunk is None or not self._handle(chunk, flying):
                # The arrival time counts: a host that was busy or suspended has not read yet what came in time.
                if chunk is not None and chunk.t_ns < deadline_ns and budget > 0:
                    continue
                if tries == TRIES or not all(each.repeatable for each in flying):
                    raise LinkLost(*(no_reply if budget > 0 else flooded)(self.port.name))
                tries += 1
                self._send(*flying, again=True)
            deadline_ns, budget = self.port.now_ns() + patience_ns, FLOOD_BYTES
            flying = [each for each in flying if not each.done]
        return [each.answers for each in asked]

    def post(self, request: wire.Message) -> PendingRequest:
        """Send a request that may be carried out twice, without waiting; its answer comes later."""
        (posted,) = self._numbered([request])
        self._send(posted)
        self._posted = [each for each in self._posted if not each.done] + [posted]
        return posted

    def repeat_if_overdue(self, posted: PendingRequest) -> None:
        """Send a posted request again if its answer is overdue."""
        if not posted.done and self.port.now_ns() - posted.sent_ns > REPLY_NS + self.latency.most_ns:
            self._send(posted, again=True)

    def seq_of(self, n: int) -> int:
        """Return the sequence number of the next request (n = 0), or of the n-th after it."""
        return (self._seq + 1 + n) % 256

    def wait(self, until_ns: int) -> int | None:
        """Receive pushed frames until the host's clock shows `until_ns`; return at the first bytes, with their time.

        Raises
        ------
        BusError : the port is gone.
        """
        chunk = self.port.read(until_ns)
        if chunk is None:
            return None
        self._handle(chunk, [])
        return chunk.t_ns

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    def _numbered(self, requests: Sequence[wire.Message]) -> Iterator[PendingRequest]:
        for request in requests:
            self._seq = (self._seq + 1) % 256
            yield PendingRequest(self._seq, request)

    def _send(self, *several: PendingRequest, again: bool = False) -> None:
        self.port.write(DELIMITER * again + b"".join(each.encoded() for each in several))
        for each in several:
            each.sent_ns, each.sent = self.port.now_ns(), each.sent + 1

    def _hello(
        self, address: int, diagnosis: PortDiagnosis, greetings: list[PendingRequest], baud: int
    ) -> wire.HelloReply | None:
        """Send HELLO again; return the answer to any of the `greetings`, since a line may be slower than the next."""
        greetings += self._numbered([wire.Hello(address=address)])
        self._send(greetings[-1], again=True)
        until_ns, budget = self.port.now_ns() + REPLY_NS, FLOOD_BYTES
        while (chunk := self.port.read(until_ns)) is not None:
            diagnosis.add(chunk.data, baud)
            for frame, reply in self._messages(chunk):
                asked = next((each for each in greetings if each.is_answered_by(frame, reply)), None)
                if asked is None:
                    continue
                if not isinstance(reply, wire.HelloReply) or reply.major != wire.MAJOR:
                    theirs = reply.major if isinstance(reply, wire.HelloReply) else 0
                    newer = "mpucal on this machine" if theirs > wire.MAJOR else "firmware on the bridge"
                    speaks = f"the bridge on {self.port.name} speaks version {theirs} of the protocol"
                    raise BusError(f"{speaks}, and mpucal {wire.MAJOR}", f"put a newer {newer}")
                self.clock.on_greeting(reply.t_us, chunk.t_ns)
                self.latency.add(chunk.t_ns - asked.sent_ns)
                return reply
            budget -= len(chunk.data)
            if chunk.t_ns >= until_ns or budget <= 0:
                diagnosis.floods += budget <= 0
                break
        return None

    def _handle(self, chunk: Chunk, flying: Sequence[PendingRequest]) -> bool:
        """Pass each message to its receiver; return True if one of the `flying` requests was answered."""
        answered = False
        for frame, reply in self._messages(chunk):
            if isinstance(reply, wire.Frames):
                self._on_frames(frame.seq, reply, self.clock.bus_time(reply.t_us, chunk.t_ns), chunk.t_ns)
                continue
            for each in (*flying, *self._posted):
                if each.is_answered_by(frame, reply):
                    if reply.status == wire.Status.NO_HELLO:
                        # The bridge's clock restarted, and this time does not belong to it.
                        raise LinkLost(f"the bridge on {self.port.name} was reset", "check its cable and supply")
                    if each.sent == 1 and not each.answers and not isinstance(each.request, STORING):
                        self.latency.add(chunk.t_ns - each.sent_ns)
                    each.answers.append(Answer(reply, self.clock.bus_time(reply.t_us, chunk.t_ns), chunk.t_ns))
                    answered = answered or each in flying
        return answered

    def _messages(self, chunk: Chunk) -> Iterator[tuple[Frame, wire.Reply]]:
        for frame in self._deframer.feed(chunk.data):
            with suppress(wire.MessageError):
                yield frame, wire.answer_of(frame.type, frame.payload)
