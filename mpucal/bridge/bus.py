"""Bus to a chip behind a serial bridge.

The bridge pushes the FIFO's content ahead of the driver: FIFO_COUNT and FIFO_R_W are answered from a buffer, each count
with the time at which the bridge read it, and losses on the way show as an overflow in INT_STATUS. A FIFO that was
started without a reset is not read ahead, so that the driver can see it fill. During a stream the driver reads
INT_STATUS together with INT_ENABLE only (chip/driver.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from ..chip import registers as reg
from ..chip.access import Reply
from ..chip.driver import STATUS_BYTES
from ..clocks import MS
from ..clocks.sample_clock import poll_phase
from ..errors import BusError, NoAnswer
from ..sources.host_bus import WIRES
from . import messages as wire
from .chip_state import CONTROLS, ChipState
from .link import Link, LinkLost
from .port import Port
from .port_errors import no_reply, request_failed
from .read_ahead import ReadAhead
from .requests import Answer

# Time without a message, besides the line's latency, after which the bridge is lost; one that was reset says so sooner.
GONE_NS = 1000 * MS
REPEAT_NS = 100 * MS
# Time for plugging a cable in again, for a boot loader's two seconds, and for a REPL to answer.
RECOVER_NS = 10_000 * MS
# An FTDI adapter delivers its bytes every 16 ms. Requests in step with that would get equally late replies, or later
# and later ones, as if the bridge's clock were off by 100 ppm.
ADAPTER_NS = 16 * MS


class BridgeBus:
    """Chip behind the bridge on `port`; the bus has the bridge's clock.

    Parameters
    ----------
    port : open; the bus closes it. address : of the chip; None lets the bridge try 0x68, then 0x69.

    Raises
    ------
    BusError : no bridge answers. NoAnswer : the bridge finds no chip.
    """

    def __init__(self, port: Port, address: int | None = None) -> None:
        self.link = Link(port, self._on_frames)
        self._port = port
        self._ahead: ReadAhead | None = None
        self._lost = False
        self._requests = 0
        self._chip = ChipState(self.link)
        self._dead: BusError | None = None
        try:
            self.address = self.link.greet(address or 0).address
            if not self.address:
                at = f"0x{address:02x}" if address else "0x68 or 0x69"
                raise NoAnswer(
                    f"the bridge on {port.name} answers, but no chip answers it at {at} on its I2C bus", WIRES
                )
        except BaseException:
            port.close()
            raise

    def read(self, register: int, count: int) -> Reply:
        """Read `count` bytes from `register` on; more than MAX_READ take several transfers."""
        ahead = self._ahead
        if ahead is not None and (register, count) == (reg.FIFO_COUNT_H, 2):
            held, t_ns, host_ns = self._wait_for_count(ahead)
            return Reply(held.to_bytes(2, "big"), t_ns, host_ns)
        if ahead is not None and register == reg.FIFO_R_W:
            return Reply(*ahead.pop(count))
        if ahead is not None and (register, count) == (reg.INT_ENABLE, STATUS_BYTES):
            return self._read_status(ahead)
        at = reg.INT_STATUS - register
        if at == count - 1:
            self._wait_out_of_step()
        reply = self._read_now(register, count)
        if self._lost and 0 <= at < count:
            self._lost, data = False, bytearray(reply.data)
            data[at] |= reg.INT_FIFO_OFLOW
            reply = reply._replace(data=bytes(data))
        return reply

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time."""
        requests: list[wire.Message] = []
        controls = register in CONTROLS
        if controls and self._ahead is not None:
            self._ahead = None
            requests.append(wire.Stream(0, 0))
        requests.append(wire.Write(register, data))
        self._chip.on_write(register, data)
        has_stream = bool(self.link.bridge.features & wire.Feature.STREAM)
        if controls and has_stream and self._chip.fills_with_frames:
            return self._start_stream(*requests)
        return self._not_after_looks(self._ask(*requests)[-1][-1].t_ns)

    def sleep_until(self, t_ns: int) -> None:
        """Receive pushed frames until the bridge's clock shows `t_ns`, as far as that is known."""
        self._wait(lambda host_ns: t_ns - self.link.clock.now(host_ns))

    def close(self) -> None:
        """Stop the stream if the bridge still listens, and close the port."""
        if self._ahead is not None and self._dead is None:
            self._stop_stream()
        self.link.close()

    def _wait(self, left_ns: Callable[[int], int]) -> None:
        """Receive pushed frames until `left_ns` of the host's time is 0; a late program receives those of the past."""
        begun_ns = self._port.now_ns()
        while True:
            left = left_ns(host_ns := self._port.now_ns())
            try:
                heard_ns = self.link.wait(host_ns + max(left, 0))
            except BusError:
                # The next access raises it.
                return
            if left <= 0 and (heard_ns is None or heard_ns >= begun_ns):
                return

    def _wait_out_of_step(self) -> None:
        """Wait a varying part of ADAPTER_NS, so that some replies are hardly delayed."""
        self._requests += 1
        until_ns = self._port.now_ns() + round((poll_phase(self._requests) + 0.5) * ADAPTER_NS)
        self._wait(lambda host_ns: until_ns - host_ns)

    def _read_now(self, register: int, count: int) -> Reply:
        answers = [answer for several in self._ask(*_reads(register, count)) for answer in several]
        begun_ns, host_ns = answers[0].t_ns, answers[0].host_ns
        shown_ns = self._not_after_looks(begun_ns)
        return Reply(b"".join(_data(answers)), shown_ns, host_ns - (begun_ns - shown_ns))

    def _read_status(self, ahead: ReadAhead) -> Reply:
        """Return INT_ENABLE to INT_STATUS during a stream.

        INT_STATUS comes from FRAMES, for which the bridge reads it. INT_ENABLE, 0 after a reset of the chip, was
        requested one poll earlier, since its reply may be late. The reply's times give the rate of the bridge's clock.
        """
        t_ns = ahead.counted_ns
        ahead_ns = self._chip.take_answer()
        if not self._chip.is_waiting:
            self._wait_out_of_step()
            self._chip.request()
        overflow = reg.INT_FIFO_OFLOW * ahead.take_overflow()
        return Reply(bytes([self._chip.int_enable, 0, overflow]), t_ns, None if ahead_ns is None else t_ns + ahead_ns)

    def _not_after_looks(self, t_ns: int) -> int:
        return t_ns if self._ahead is None else self._ahead.not_after_looks(t_ns)

    def _start_stream(self, *before: wire.Message) -> int:
        """Send the requests `before` and start the stream; return the time of the last of `before`.

        All are sent at once, since the FIFO must not fill while the host waits for a reply.
        """
        self._lost = False
        self._chip.cancel()
        # Prepared before the request: the first frames may come together with its reply.
        self._ahead = ReadAhead(self.link.seq_of(len(before)))
        try:
            # This many frames fill one message.
            batch = wire.MAX_READ // reg.FRAME_BYTES
            answers = self._ask(*before, wire.Stream(reg.FRAME_BYTES, batch))
        except BusError:
            if self._ahead is not None:
                self._ahead = None
                self._stop_stream()
            raise
        return answers[-2][-1].t_ns

    def _stop_stream(self) -> None:
        with suppress(BusError):
            self.link.ask(wire.Stream(0, 0))

    def _wait_for_count(self, ahead: ReadAhead) -> tuple[int, int, int]:
        give_up_ns = self._port.now_ns() + GONE_NS + self.link.latency.most_ns
        while not ahead.can_count:
            try:
                self._chip.repeat_if_overdue()
                heard_ns = self.link.wait(min(give_up_ns, self._port.now_ns() + REPEAT_NS))
                # Bytes that came in time count, even if this busy program reads them late.
                if (self._port.now_ns() if heard_ns is None else heard_ns) >= give_up_ns:
                    raise LinkLost(*no_reply(self._port.name))
            except BusError as error:
                self._recover(error)
                raise
        return ahead.count()

    def _on_frames(self, seq: int, frames: wire.Frames, t_ns: int, host_ns: int) -> None:
        if self._ahead is not None and seq == self._ahead.seq:
            self._ahead.push(frames, t_ns, host_ns)

    def _ask(self, *requests: wire.Message) -> list[list[Answer]]:
        """Send the requests and return their answers, none of which is a failure.

        Raises
        ------
        BusError : the bridge could not do it; or it was lost and is greeted again, after which a retry may succeed.
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
            if status != wire.Status.OK:
                # A burst is several transfers, and the first ones may have taken bytes.
                kind = NoAnswer if status == wire.Status.NO_ANSWER and len(several) == 1 else BusError
                raise kind(*request_failed(self._port.name, status))
        return answers

    def _recover(self, error: BusError) -> None:
        """Greet the bridge again, and reopen its port if that was gone; the buffer is lost.

        Raises
        ------
        BusError : the bridge does not come back.
        """
        self._ahead, self._lost = None, True
        until_ns = self._port.now_ns() + RECOVER_NS
        try:
            if isinstance(error, LinkLost):
                self._port.revive(until_ns)
            else:
                self._port.reopen(until_ns)
            self.link.greet(self.address, until_ns - self._port.now_ns())
        except BusError as still:
            self._dead = error
            raise error from still


def _reads(register: int, count: int) -> Iterator[wire.Message]:
    """Yield the requests for `count` bytes from `register` on."""
    if register == reg.FIFO_R_W:
        yield wire.Burst(register, count) if count > wire.MAX_READ else wire.Read(register, count)
        return
    for at in range(0, count, wire.MAX_READ):
        yield wire.Read(register + at, min(wire.MAX_READ, count - at))


def _data(answers: Iterable[Answer]) -> Iterator[bytes]:
    for answer in answers:
        if isinstance(answer.reply, wire.ReadReply | wire.BurstReply):
            yield answer.reply.data
