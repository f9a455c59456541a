"""State of the chip behind a bridge: its FIFO by the register writes, and INT_ENABLE, which a reset of the chip clears.

Source: RM-MPU-6000A r4.2, registers 35, 104, 106, 107 and 116.
"""

from __future__ import annotations

from ..chip import registers as reg
from ..chip.families import FAMILIES
from .link import Link
from .messages import Read, ReadReply
from .requests import PendingRequest

# Values of FIFO_EN with which a frame has FRAME_BYTES.
WHOLE_FRAME = frozenset(row.fifo_en_frame for row in FAMILIES)
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
        self._fifo_en = self._user_ctrl = 0
        self._begins_with_a_frame = False

    def on_write(self, register: int, data: bytes) -> None:
        """Take note of a write of one of the registers, which the driver writes one by one."""
        value = data[0]
        if register == reg.PWR_MGMT_1 and value & reg.PWR_MGMT_1_DEVICE_RESET:
            self._fifo_en = self._user_ctrl = 0
            self._begins_with_a_frame = False
        elif register == reg.FIFO_EN:
            self._fifo_en = value
        elif register == reg.USER_CTRL:
            self._user_ctrl = value
            self._begins_with_a_frame |= bool(value & reg.USER_CTRL_FIFO_RESET)
        elif register == reg.INT_ENABLE:
            self.int_enable = value

    @property
    def fills_with_frames(self) -> bool:
        """True if the FIFO runs, and begins with a whole frame."""
        runs = self._fifo_en in WHOLE_FRAME and self._user_ctrl & reg.USER_CTRL_FIFO_EN
        return bool(runs and self._begins_with_a_frame)

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
