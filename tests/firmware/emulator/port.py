"""Line to an emulated board in the board's own time: the board runs while its host waits."""

from mpucal.bridge.port import Chunk

STEP_S = 0.000_25


class BoardPort:
    """Port with the clock of the board, an emulator.board.Board, so that the speed of this machine has no effect."""

    name = "the emulated board"
    bauds = (500_000,)

    def __init__(self, board) -> None:
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

    def revive(self, until_ns: int) -> None:
        """Do nothing: firmware starts by itself."""

    def close(self) -> None:
        """Do nothing: the board keeps running."""
