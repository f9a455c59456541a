"""State of the chip behind a bridge: its FIFO by the register writes, and INT_ENABLE, which a reset of the chip clears.

Source: RM-MPU-6000A r4.2, registers 35, 104, 106, 107 and 116.
"""

from __future__ import annotations

from ..chip import registers as reg
from ..chip.families import FAMILIES
from .link import Link
from .messages import Read, ReadReply
from .requests import PendingRequest

# Bytes that each bit of FIFO_EN adds to a frame; the lowest three enable other chips, of unknown size.
FRAME_PARTS = (
    (reg.FIFO_EN_ACCEL, 6),
    (reg.FIFO_EN_TEMP, 2),
    (reg.FIFO_EN_XG, 2),
    (reg.FIFO_EN_YG, 2),
    (reg.FIFO_EN_ZG, 2),
)
OTHER_CHIPS = 0x07
# On an ICM-20602 and its like, these bits add the temperature and the whole gyroscope too.
WHOLE_FRAME = {row.fifo_en_frame: reg.FRAME_BYTES for row in FAMILIES if row.fifo_en_with_temperature}
# A write to one of these may stop the FIFO or change its content.
CONTROLS = frozenset((reg.FIFO_EN, reg.USER_CTRL, reg.SIGNAL_PATH_RESET, reg.PWR_MGMT_1))


class ChipState:
    """State of the chip behind `link`.

    A driver that drains the FIFO resets it first, so that it begins with a frame (register 106). One that starts it
    without a reset tests how much it holds. During a stream, INT_ENABLE is requested without waiting for the reply.

    Attributes
    ----------
    int_enable : last value of INT_ENABLE that was read or written.
    """

    def __init__(self, link: Link) -> None:
        self.int_enable = 0
        self._link = link
        self._pending: PendingRequest | None = None
        self._held = dict.fromkeys(CONTROLS, 0)
        self._begins_with_a_frame = False

    def on_write(self, register: int, data: bytes) -> None:
        """Take note of `data` written from `register` on."""
        for at, value in enumerate(data, register):
            if at == reg.PWR_MGMT_1 and value & reg.PWR_MGMT_1_DEVICE_RESET:
                self._held = dict.fromkeys(CONTROLS, 0)
                self._begins_with_a_frame = False
            elif at in CONTROLS:
                self._held[at] = value
            elif at == reg.INT_ENABLE:
                self.int_enable = value
            if at == reg.USER_CTRL and value & reg.USER_CTRL_FIFO_RESET:
                self._begins_with_a_frame = True

    @property
    def frame_bytes(self) -> int:
        """Length of the frames to drain; 0 if the FIFO does not run, or does not begin with a frame."""
        enabled = self._held[reg.FIFO_EN]
        runs = self._held[reg.USER_CTRL] & reg.USER_CTRL_FIFO_EN and not enabled & OTHER_CHIPS
        if not (runs and self._begins_with_a_frame):
            return 0
        return WHOLE_FRAME.get(enabled) or sum(size for bit, size in FRAME_PARTS if enabled & bit)

    @property
    def is_waiting(self) -> bool:
        """True if an answer is on its way."""
        return self._pending is not None

    def request(self) -> None:
        """Request INT_ENABLE; the answer comes later."""
        self._pending = self._link.post(Read(reg.INT_ENABLE, 1))

    def take_answer(self) -> int | None:
        """Take the answer if it has come, and return the host's clock less the bridge's [ns]; None if it has not."""
        if self._pending is None or not self._pending.done:
            return None
        answer, self._pending = self._pending.answers[0], None
        if isinstance(answer.reply, ReadReply) and answer.reply.data:
            self.int_enable = answer.reply.data[0]
        return answer.host_ns - answer.t_ns

    def repeat_if_overdue(self) -> None:
        """Request INT_ENABLE again if the answer is overdue."""
        if self._pending is not None:
            self._link.repeat_if_overdue(self._pending)

    def cancel(self) -> None:
        """Stop waiting for an answer."""
        self._pending = None
