"""Buffer of what a bridge has pushed, presented as the FIFO that the driver reads.

See firmware_protocol.md, "FRAMES": a look is one reading of FIFO_COUNT and all frames counted then.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from ..chip.registers import FRAME_BYTES
from .messages import MAX_BATCH, Frames, Status


@dataclass(frozen=True)
class Look:
    """Content of the FIFO at `t_ns`, which arrived at `host_ns`; `lost`: it is not valid."""

    t_ns: int
    host_ns: int
    data: bytes
    lost: bool


class ReadAhead:
    """Frames of one stream, in order and by whole looks; a loss shows as an overflow in its place.

    Parameters
    ----------
    seq : of the STREAM that started it.

    Attributes
    ----------
    counted_ns : time of the last `count`.
    """

    def __init__(self, seq: int) -> None:
        self.seq = seq
        self.counted_ns = 0
        self._counted_host_ns = 0
        self._counted = bytearray()
        self._looks: deque[Look] = deque()
        self._begun: list[Frames] = []
        self._begun_t_ns = 0
        self._next_index = 0
        self._drops: int | None = None
        self._last_byte = 0
        self._overflow = False

    def push(self, frames: Frames, t_ns: int, host_ns: int) -> None:
        """Add `frames` that arrived at `host_ns`; `t_ns` is the bus time of their look."""
        if not self._continues(frames):
            self.lose(t_ns, host_ns)
            return
        self._drops = frames.drops
        self._next_index = (frames.index + len(frames.frames) // FRAME_BYTES) % 2**16
        self._begun.append(frames)
        self._begun_t_ns = t_ns
        if frames.left == 0:
            data = b"".join(part.frames for part in self._begun)
            self._looks.append(Look(t_ns, host_ns, data, lost=False))
            self._begun.clear()

    def lose(self, t_ns: int, host_ns: int) -> None:
        """Note that frames were lost at about `t_ns`."""
        self._begun.clear()
        if not (self._looks and self._looks[-1].lost):
            self._looks.append(Look(t_ns, host_ns, b"", lost=True))

    @property
    def can_count(self) -> bool:
        """True if `count` has a value without waiting."""
        return bool(self._counted or self._looks)

    def count(self) -> tuple[int, int, int]:
        """Return FIFO_COUNT, its time and its arrival at the host [ns], as the count was then.

        Several looks are joined only up to what chips hold without corruption, however long the driver was away; the
        next call has the rest.
        """
        while self._looks and not (self._counted and self._looks[0].lost):
            look = self._looks[0]
            if self._counted and len(self._counted) + len(look.data) > MAX_BATCH * FRAME_BYTES:
                break
            self._looks.popleft()
            self._counted += look.data
            self.counted_ns, self._counted_host_ns = look.t_ns, look.host_ns
            if look.lost:
                self._overflow = True
                break
        return len(self._counted), self.counted_ns, self._counted_host_ns

    def pop(self, count: int) -> tuple[bytes, int]:
        """Read FIFO_R_W: the oldest `count` bytes of the counted ones; an empty FIFO repeats the last byte."""
        data = bytes(self._counted[:count])
        del self._counted[:count]
        if data:
            self._last_byte = data[-1]
        return data + bytes([self._last_byte]) * (count - len(data)), self.counted_ns

    def take_overflow(self) -> bool:
        """Return True once if something was lost before the last `count`: the overflow flag of INT_STATUS."""
        overflow, self._overflow = self._overflow, False
        return overflow

    def not_after_looks(self, t_ns: int) -> int:
        """Return `t_ns`, but no later than the oldest look that was not counted yet: time must not go back."""
        if self._looks:
            return min(t_ns, self._looks[0].t_ns)
        return min(t_ns, self._begun_t_ns) if self._begun else t_ns

    def _continues(self, frames: Frames) -> bool:
        """Return True if no frames were lost before these."""
        if frames.status != Status.OK or len(frames.frames) % FRAME_BYTES:
            return False
        if frames.index != self._next_index or self._drops not in (None, frames.drops):
            return False
        # Messages of one look have the same time, and count down.
        return not self._begun or (
            frames.t_us == self._begun[-1].t_us
            and frames.left + len(frames.frames) // FRAME_BYTES == self._begun[-1].left
        )
