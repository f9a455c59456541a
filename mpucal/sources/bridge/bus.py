"""A chip behind a serial bridge, as a bus.

What the bridge pushes is read-ahead below the bus: FIFO_COUNT and FIFO_R_W are answered from it, each count with
the time at which the bridge read it, and what was lost on the way shows as an overflow in INT_STATUS. Nothing is
read ahead of a FIFO that was started without a reset: whoever lets it fill sees it fill.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from ...chip import registers as reg
from ...chip.access import Reply
from ...chip.clock import poll_phase
from ...errors import BusError, NoAnswer
from .fifo_tracker import CONTROLS, FifoTracker
from .link import MS, Link, LinkLost
from .link_errors import no_chip, no_reply, refused
from .messages import (
    MAX_BURST,
    MAX_READ,
    MAX_WRITE,
    Burst,
    BurstReply,
    Feature,
    Frames,
    Message,
    Read,
    ReadReply,
    Status,
    Stream,
    Write,
)
from .pending_request import Answer
from .port import Port
from .read_ahead import ReadAhead
from .reset_monitor import ResetMonitor

# Four frames of 14 bytes fill one message.
BATCH = 4
# without a message, and with the line's latency on top: a bridge that was reset says so before
GONE_NS = 1000 * MS
REMIND_NS = 100 * MS
# A cable is plugged in again, and a boot loader waits for two seconds.
RECOVER_NS = 10_000 * MS
# An FTDI adapter hands over what came every 16 ms. What is asked in step with that is answered as late each time, or
# later and later, as if the bridge's clock were off by 100 ppm.
HELD_NS = 16 * MS


class BridgeBus:
    """The chip behind the bridge on `port`; its clock is the bridge's.

    Parameters
    ----------
    port : open; the bus closes it. address : where the chip is; None lets the bridge try 0x68, then 0x69.

    Raises
    ------
    BusError : no bridge answers. NoAnswer : it finds no chip.
    """

    def __init__(self, port: Port, address: int | None = None) -> None:
        self.link = Link(port, self._pushed)
        self._port = port
        self._watch = FifoTracker()
        self._ahead: ReadAhead | None = None
        self._lost = False
        self._asked = 0
        self._beside = ResetMonitor(self.link)
        self._dead: BusError | None = None
        try:
            self._address = self.link.greet(address or 0).address
            if not self._address:
                raise NoAnswer(*no_chip(port.name, address))
        except BaseException:
            port.close()
            raise

    @property
    def address(self) -> int:
        """Where the chip answers."""
        return self._address

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on; where that is more than MAX_READ, in several transfers."""
        ahead = self._ahead
        if ahead is not None and (register, count) == (reg.FIFO_COUNT_H, 2):
            held, t_ns, host_ns = self._count(ahead)
            return Reply(held.to_bytes(2, "big"), t_ns, host_ns)
        if ahead is not None and register == reg.FIFO_R_W:
            return Reply(*ahead.pop(count))
        if register == reg.FIFO_R_W:
            try:
                return self._read_now(register, count)
            except NoAnswer as error:
                # a bridge makes several transfers of it, and the first may have taken bytes
                raise BusError(error.what, error.remedy) from error
        at = reg.INT_STATUS - register
        if ahead is not None and register == reg.INT_ENABLE and at == count - 1:
            return self._status(ahead)
        if not 0 <= at < count:
            return self._read_now(register, count)
        if at == count - 1:
            self._step_out_of_line()
        return self._judged(self._read_now(register, count), at)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time."""
        if len(data) > MAX_WRITE:
            raise BusError(f"a bridge writes at most {MAX_WRITE} bytes at once, not {len(data)}", "write less at once")
        requests: list[Message] = []
        controls = not CONTROLS.isdisjoint(range(register, register + len(data)))
        if controls and self._ahead is not None:
            self._ahead = None
            requests.append(Stream(0, 0))
        requests.append(Write(register, data))
        self._watch.on_write(register, data)
        self._beside.on_write(register, data)
        if controls and self._can_read_ahead:
            return self._start(*requests)
        return self._seen_from(self._ask(*requests)[-1][-1].t_ns)

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the bridge's clock shows `t_ns`, as far as is known, and take what it pushes."""
        self._wait(lambda host_ns: t_ns - self.link.clock.now(host_ns))

    def close(self) -> None:
        """Stop what the bridge pushes, if it still listens, and let go of the port."""
        if self._ahead is not None and self._dead is None:
            with suppress(BusError):
                self.link.ask(Stream(0, 0))
        self.link.close()

    def _wait(self, left_ns: Callable[[int], int]) -> None:
        """Take what is pushed until nothing is left of the time that `left_ns` gives for the host's."""
        while (left := left_ns(host_ns := self._port.now_ns())) > 0:
            try:
                self.link.wait(host_ns + left)
            except BusError:
                # the next access says so
                return

    def _step_out_of_line(self) -> None:
        """Wait for another part of HELD_NS each time, so that some reply is hardly held back."""
        self._asked += 1
        until_ns = self._port.now_ns() + round((poll_phase(self._asked) + 0.5) * HELD_NS)
        self._wait(lambda host_ns: until_ns - host_ns)

    def _read_now(self, register: int, count: int) -> Reply:
        if count > MAX_BURST:
            raise BusError(f"a bridge reads at most {MAX_BURST} bytes at once, not {count}", "read less at once")
        answers = [answer for several in self._ask(*_reads(register, count)) for answer in several]
        begun_ns, host_ns = answers[0].t_ns, answers[0].host_ns
        seen_ns = self._seen_from(begun_ns)
        return Reply(b"".join(_data(answers)), seen_ns, host_ns - (begun_ns - seen_ns))

    def _status(self, ahead: ReadAhead) -> Reply:
        """INT_ENABLE to INT_STATUS while the bridge pushes.

        INT_STATUS is what FRAMES say, whose bridge reads it. INT_ENABLE, 0 in a chip that was reset, was asked for a
        poll ago: nobody waits for a reply, which may be late. Its times tell how fast the bridge's clock runs.
        """
        t_ns = ahead.shown_ns
        ahead_ns = self._beside.take()
        if not self._beside.is_asked:
            self._step_out_of_line()
            self._beside.ask()
        overflow = reg.INT_FIFO_OFLOW * ahead.take_overflow()
        return Reply(bytes([self._beside.held, 0, overflow]), t_ns, None if ahead_ns is None else t_ns + ahead_ns)

    def _judged(self, reply: Reply, at: int) -> Reply:
        """What was read, with INT_STATUS at `at`: it tells what was lost on the way to the host, too."""
        if self._ahead is not None:
            if reply.data[at] & reg.INT_FIFO_OFLOW:
                # the reading cleared it, and the bridge does not see it any more
                self._ahead.lose(reply.t_ns, reply.host_ns or 0)
            lost = self._ahead.take_overflow()
        else:
            lost, self._lost = self._lost, False
        data = bytearray(reply.data)
        data[at] |= reg.INT_FIFO_OFLOW * lost
        return reply._replace(data=bytes(data))

    def _seen_from(self, t_ns: int) -> int:
        return t_ns if self._ahead is None else self._ahead.seen_from(t_ns)

    @property
    def _can_read_ahead(self) -> bool:
        has_stream = bool(self.link.bridge.features & Feature.STREAM)
        return has_stream and self._ahead is None and bool(self._watch.frame_bytes)

    def _start(self, *before: Message) -> int:
        """Let the bridge push, right behind the requests `before`; returns the time of the last of those.

        The FIFO must not fill while the host waits for a reply, so all of them are sent at once.
        """
        self._lost = False
        self._beside.forget()
        frame_bytes = self._watch.frame_bytes
        # before it is asked for: what it pushes may come together with its reply
        self._ahead = ReadAhead(self.link.seq_of(len(before)), frame_bytes)
        try:
            answers = self._ask(*before, Stream(frame_bytes, BATCH))
        except BusError:
            if self._ahead is not None:
                self._ahead = None
                with suppress(BusError):
                    self.link.ask(Stream(0, 0))
            raise
        return answers[-2][-1].t_ns

    def _count(self, ahead: ReadAhead) -> tuple[int, int, int]:
        give_up_ns = self._port.now_ns() + GONE_NS + self.link.latency.most_ns
        while not ahead.can_count:
            try:
                if self._port.now_ns() >= give_up_ns:
                    raise LinkLost(*no_reply(self._port.name))
                self._beside.remind()
                self.link.wait(min(give_up_ns, self._port.now_ns() + REMIND_NS))
            except BusError as error:
                self._recover(error)
                raise
        return ahead.count()

    def _pushed(self, seq: int, frames: Frames, t_ns: int, host_ns: int) -> None:
        if self._ahead is not None and seq == self._ahead.seq:
            self._ahead.push(frames, t_ns, host_ns)

    def _ask(self, *requests: Message) -> list[list[Answer]]:
        """The answers, none of them a failure.

        Raises
        ------
        BusError : the bridge could not do it; or it was lost, and is greeted again: then asking again may help.
        """
        if self._dead is not None:
            raise self._dead
        try:
            answers = self.link.ask(*requests)
        except BusError as error:
            self._recover(error)
            raise
        for several in answers:
            status = several[-1].reply.status
            if status != Status.OK:
                kind = NoAnswer if status == Status.NO_ANSWER else BusError
                raise kind(*refused(self._port.name, status))
        return answers

    def _recover(self, error: BusError) -> None:
        """Greet the bridge again, on its port opened anew where that was gone; what it pushed is lost.

        Raises
        ------
        BusError : it does not come back.
        """
        self._ahead, self._lost = None, True
        until_ns = self._port.now_ns() + RECOVER_NS
        try:
            if isinstance(error, LinkLost):
                self._port.revive(until_ns)
            else:
                self._port.reopen(until_ns)
            self.link.greet(self._address, until_ns - self._port.now_ns())
        except BusError as still:
            self._dead = error
            raise error from still


def _reads(register: int, count: int) -> Iterator[Message]:
    """The requests for `count` bytes from `register` on."""
    if register == reg.FIFO_R_W:
        yield Burst(register, count) if count > MAX_READ else Read(register, count)
        return
    for at in range(0, count, MAX_READ):
        yield Read(register + at, min(MAX_READ, count - at))


def _data(answers: Iterable[Answer]) -> Iterator[bytes]:
    for answer in answers:
        if isinstance(answer.reply, ReadReply | BurstReply):
            yield answer.reply.data
