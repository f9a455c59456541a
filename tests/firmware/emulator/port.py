"""The line to an emulated board in the board's own time: a Port that lets the board run while its host waits."""

from __future__ import annotations

from typing import Protocol

from mpucal.sources.bridge.port import Chunk

STEP_S = 0.000_25


class Runs(Protocol):
    """What it needs of a board."""

    now_s: float

    def run(self, seconds: float) -> None: ...
    def send(self, data: bytes) -> int: ...
    def receive(self) -> bytes: ...
    def press_reset(self) -> None: ...


class BoardPort:
    """A Port whose clock is the board's: nothing depends on how fast this machine is."""

    name = "the emulated board"
    bauds = (500_000,)

    def __init__(self, board: Runs) -> None:
        self._board = board

    def now_ns(self) -> int:
        """The board's clock."""
        return round(self._board.now_s * 1e9)

    def read(self, until_ns: int) -> Chunk | None:
        """Let the board run until it says something, or its clock shows `until_ns`."""
        while not (data := self._board.receive()):
            if self.now_ns() >= until_ns:
                return None
            self._board.run(STEP_S)
        return Chunk(data, self.now_ns())

    def write(self, data: bytes) -> None:
        """Send `data`."""
        self._board.send(data)

    def set_baud(self, baud: int) -> None:
        """There is one rate."""

    def reopen(self) -> None:
        """Which resets the board."""
        self._board.press_reset()

    def close(self) -> None:
        """The board runs on."""
