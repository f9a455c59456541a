"""Monitor of INT_ENABLE, which a reset of the chip clears: it is requested during a stream without waiting for it."""

from __future__ import annotations

from ..chip.registers import INT_ENABLE
from .link import Link
from .messages import Read, ReadReply
from .pending_request import PendingRequest


class ResetMonitor:
    """Monitor of the chip behind `link`.

    Attributes
    ----------
    held : last value of INT_ENABLE that was read or written.
    """

    def __init__(self, link: Link) -> None:
        self.held = 0
        self._link = link
        self._pending: PendingRequest | None = None

    def on_write(self, register: int, data: bytes) -> None:
        """Take note of `data` written from `register` on."""
        if register <= INT_ENABLE < register + len(data):
            self.held = data[INT_ENABLE - register]

    @property
    def is_waiting(self) -> bool:
        """True if an answer is on its way."""
        return self._pending is not None

    def request(self) -> None:
        """Request the register; the answer comes later."""
        self._pending = self._link.post(Read(INT_ENABLE, 1))

    def take_answer(self) -> int | None:
        """Take the answer if it has come, and return the host's clock less the bridge's [ns]; None if it has not."""
        if self._pending is None or not self._pending.done:
            return None
        answer, self._pending = self._pending.answers[0], None
        if isinstance(answer.reply, ReadReply) and answer.reply.data:
            self.held = answer.reply.data[0]
        return answer.host_ns - answer.t_ns

    def repeat_if_overdue(self) -> None:
        """Request the register again if the answer is overdue."""
        if self._pending is not None:
            self._link.repeat_if_overdue(self._pending)

    def cancel(self) -> None:
        """Stop waiting for an answer."""
        self._pending = None
