"""Frames that an emulated bridge streams from the FIFO; see firmware_protocol.md, "FRAMES"."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ...chip import registers as reg
from ...chip.access import Bus
from ...errors import BusError, NoAnswer
from ...sources.bridge.clock import US, WRAP_US
from ...sources.bridge.messages import MAX_LOOK, MAX_READ, Frames, Status, Stream

BEAT_NS = 100_000_000
INDEX_WRAP = 2**16


class FrameStreamer:
    """A stream of FIFO frames.

    Parameters
    ----------
    bus : returns the chip's bus, or raises NoAnswer. seq, request : of the STREAM that starts it now.
    drops : number of earlier streams' drops. now_ns : the bridge's clock.
    """

    def __init__(
        self, bus: Callable[[], Bus], seq: int, request: Stream, drops: int, now_ns: Callable[[], int]
    ) -> None:
        self._bus, self.seq, self.drops = bus, seq, drops
        self._frame_bytes, self._batch = request.frame_bytes, request.batch
        self._index = 0
        self._status = Status.OK
        self._now_ns = now_ns
        self._pushed_ns = now_ns()

    def poll(self) -> list[Frames]:
        """Return the messages that are due."""
        now_ns = self._now_ns()
        late = now_ns - self._pushed_ns >= BEAT_NS
        if self._status == Status.OK:
            try:
                made = list(self._read_fifo(late))
            except BusError as error:
                made = [self._halt(Status.NO_ANSWER if isinstance(error, NoAnswer) else Status.BUS_FAILED, now_ns)]
        else:
            made = [self._frames(now_ns)] if late else []
        if made:
            self._pushed_ns = now_ns
        return made

    def _read_fifo(self, late: bool) -> Iterator[Frames]:
        t_ns = self._now_ns()
        n = int.from_bytes(self._bus().read(reg.FIFO_COUNT_H, 2).data, "big") // self._frame_bytes
        if n > MAX_LOOK:
            yield self._halt(Status.OVERFLOW, t_ns)
            return
        if n < self._batch and not late:
            return
        a_message = MAX_READ // self._frame_bytes
        left = n
        while left > a_message:
            left -= a_message
            yield self._frames(t_ns, self._read(a_message), left)
        last = self._read(left)
        if self._bus().read(reg.INT_STATUS, 1).data[0] & reg.INT_FIFO_OFLOW:
            yield self._halt(Status.OVERFLOW, t_ns)
        else:
            yield self._frames(t_ns, last)

    def _read(self, frames: int) -> bytes:
        return self._bus().read(reg.FIFO_R_W, frames * self._frame_bytes).data if frames else b""

    def _frames(self, t_ns: int, data: bytes = b"", left: int = 0) -> Frames:
        made = Frames(self._status, t_ns // US % WRAP_US, self._index, self.drops % INDEX_WRAP, left, data)
        self._index = (self._index + len(data) // self._frame_bytes) % INDEX_WRAP
        return made

    def _halt(self, status: Status, t_ns: int) -> Frames:
        self.drops += 1
        self._status = status
        return self._frames(t_ns)
