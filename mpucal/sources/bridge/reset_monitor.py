"""INT_ENABLE, asked for beside a stream without waiting for it: 0 in a chip that was reset meanwhile."""

from __future__ import annotations

from ...chip.registers import INT_ENABLE
from .link import Link
from .messages import Read, ReadReply
from .pending_request import PendingRequest


class ResetMonitor:
    """The register of the chip behind `link`.

    Attributes
    ----------
    held : what it held when it was read or written last.
    """

    def __init__(self, link: Link) -> None:
        self.held = 0
        self._link = link
        self._asked: PendingRequest | None = None

    def on_write(self, register: int, data: bytes) -> None:
        """`data` was written from `register` on."""
        if register <= INT_ENABLE < register + len(data):
            self.held = data[INT_ENABLE - register]

    @property
    def is_asked(self) -> bool:
        """Whether an answer is on its way."""
        return self._asked is not None

    def ask(self) -> None:
        """Ask for it; its answer comes by and by."""
        self._asked = self._link.post(Read(INT_ENABLE, 1))

    def take(self) -> int | None:
        """By how much the host's clock is ahead of the bridge's by the answer that has come [ns]; None: none has."""
        if self._asked is None or not self._asked.done:
            return None
        answer, self._asked = self._asked.answers[0], None
        if isinstance(answer.reply, ReadReply) and answer.reply.data:
            self.held = answer.reply.data[0]
        return answer.host_ns - answer.t_ns

    def remind(self) -> None:
        """Ask again for what is overdue."""
        if self._asked is not None:
            self._link.remind(self._asked)

    def forget(self) -> None:
        """Nobody waits for an answer any more."""
        self._asked = None
