"""Line to an emulated board in the board's own time: the board runs while its host waits."""

from __future__ import annotations

from typing import Protocol

from mpucal.bridge.port import Chunk

STEP_S = 0.000_25


class Runs(Protocol):
    """Interface to a board."""

    now_s: float

    def run(self, seconds: float) -> None: ...
    def send(self, data: bytes) -> int: ...
    def receive(self) -> bytes: ...
    def press_reset(self) -> None: ...


class BoardPort:
    """Port with the board's clock, so that the speed of this machine has no effect."""

    name = "the emulated board"
    bauds = (500_000,)

    def __init__(self, board: Runs) -> None:
        self._board = board

    def now_ns(self) -> int:
        """Return the board's time."""
        return round(self._board.now_s * 1e9)

    def read(self, until_ns: int) -> Chunk | None:
        """Run the board until it sends bytes, or its clock shows `until_ns`."""
        while not (data := self._board.receive()):
            if self.now_ns() >= until_ns:
                return None
            self._board.run(STEP_S)
        return Chunk(data, self.now_ns())

    def write(self, data: bytes) -> None:
        """Send `data`."""
        self._board.send(data)

    def set_baud(self, baud: int) -> None:
        """Do nothing: there is one rate."""

    def reopen(self) -> None:
        """Reset the board."""
        self._board.press_reset()

    def close(self) -> None:
        """Do nothing: the board keeps running."""
