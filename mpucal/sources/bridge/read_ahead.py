"""What a bridge has pushed, as the FIFO that the driver reads.

See firmware_protocol.md, "FRAMES": a look is one reading of FIFO_COUNT and all frames counted then.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from .messages import MAX_BATCH, Frames, Status

INDEX_WRAP = 2**16


@dataclass(frozen=True)
class FifoReading:
    """What was found in the FIFO at `t_ns`, and heard at `host_ns`; where `lost`, nothing that can be believed."""

    t_ns: int
    host_ns: int
    data: bytes
    lost: bool


class ReadAhead:
    """The frames of one stream, whole looks only, in order; what was lost shows as an overflow in its place.

    Parameters
    ----------
    seq : of the STREAM that started it. frame_bytes : of one frame.
    """

    def __init__(self, seq: int, frame_bytes: int) -> None:
        self.seq = seq
        self._frame_bytes = frame_bytes
        self._looks: deque[FifoReading] = deque()
        self._begun: list[Frames] = []
        self._begun_t_ns = 0
        self._next_index = 0
        self._drops: int | None = None
        self._shown = bytearray()
        self._shown_t_ns = self._shown_host_ns = 0
        self._last_byte = 0
        self._overflow = False

    def push(self, frames: Frames, t_ns: int, host_ns: int) -> None:
        """`frames` came at `host_ns`; `t_ns` is the bus time of its look."""
        if self._is_lost(frames):
            self.lose(t_ns, host_ns)
            return
        self._drops = frames.drops
        self._next_index = (frames.index + len(frames.frames) // self._frame_bytes) % INDEX_WRAP
        self._begun.append(frames)
        self._begun_t_ns = t_ns
        if frames.left == 0:
            data = b"".join(part.frames for part in self._begun)
            self._looks.append(FifoReading(t_ns, host_ns, data, lost=False))
            self._begun.clear()

    def lose(self, t_ns: int, host_ns: int) -> None:
        """Frames were lost about `t_ns`."""
        self._begun.clear()
        if not (self._looks and self._looks[-1].lost):
            self._looks.append(FifoReading(t_ns, host_ns, b"", lost=True))

    @property
    def can_count(self) -> bool:
        """Whether FIFO_COUNT has something to say without waiting."""
        return bool(self._shown or self._looks)

    def count(self) -> tuple[int, int, int]:
        """FIFO_COUNT, its time and when the host heard of it [ns]: of whole looks, as the count was at that time.

        Of several looks never more than chips hold soundly, however long nobody asked; the rest is for the next time.
        """
        while self._looks and not (self._shown and self._looks[0].lost):
            look = self._looks[0]
            if self._shown and len(self._shown) + len(look.data) > MAX_BATCH * self._frame_bytes:
                break
            self._looks.popleft()
            self._shown += look.data
            self._shown_t_ns, self._shown_host_ns = look.t_ns, look.host_ns
            if look.lost:
                self._overflow = True
                break
        return len(self._shown), self._shown_t_ns, self._shown_host_ns

    @property
    def shown_ns(self) -> int:
        """The time of what was counted last."""
        return self._shown_t_ns

    def pop(self, count: int) -> tuple[bytes, int]:
        """FIFO_R_W: the oldest `count` bytes of what was counted; where it is empty, the last again."""
        data = bytes(self._shown[:count])
        del self._shown[:count]
        if data:
            self._last_byte = data[-1]
        return data + bytes([self._last_byte]) * (count - len(data)), self._shown_t_ns

    def take_overflow(self) -> bool:
        """INT_STATUS: whether something was lost before what was counted last; told once."""
        overflow, self._overflow = self._overflow, False
        return overflow

    def seen_from(self, t_ns: int) -> int:
        """When something that was done at `t_ns` was done for who still has looks of before to count.

        Time would go back for him otherwise, and he would take himself to be up to date.
        """
        if self._looks:
            return min(t_ns, self._looks[0].t_ns)
        return min(t_ns, self._begun_t_ns) if self._begun else t_ns

    def _is_lost(self, frames: Frames) -> bool:
        if frames.status != Status.OK or len(frames.frames) % self._frame_bytes:
            return True
        if frames.index != self._next_index or frames.drops != (frames.drops if self._drops is None else self._drops):
            return True
        # the same look goes on, and counts down
        return bool(self._begun) and (
            frames.t_us != self._begun[-1].t_us
            or frames.left + len(frames.frames) // self._frame_bytes != self._begun[-1].left
        )
