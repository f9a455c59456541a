"""A board that runs MicroPython, as a port: the bridge is pasted into its REPL, and runs until the port is closed."""

from __future__ import annotations

import ast
from contextlib import suppress
from pathlib import Path

from ...errors import BusError
from .frame import DELIMITER, Frame
from .messages import Hello, Leave
from .port import Chunk, Port, SerialPort
from .repl import RawRepl

PROGRAM = Path(__file__).with_name("board.py")
# what a REPL on a UART runs at; on USB any rate will do
BAUDS = (115_200,)
ENTER_NS = 10_000_000_000


class MicroPythonPort:
    """The bridge that runs on the board behind `port`; see Port.

    Parameters
    ----------
    text : PORT[:BAUD], or a URL; or a port that is open. pins : SDA and SCL, numbers or names; empty: the board's own.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, no MicroPython there, or one that cannot run the bridge.
    """

    def __init__(self, text: str | Port, pins: tuple[int | str, ...] = ()) -> None:
        self._port: Port = SerialPort(text, BAUDS) if isinstance(text, str) else text
        self.name, self.bauds = self._port.name, self._port.bauds[:1]
        self._pins = tuple(pins)
        try:
            self.revive(self.now_ns() + ENTER_NS)
        except BaseException:
            self._port.close()
            raise

    def now_ns(self) -> int:
        """See Port."""
        return self._port.now_ns()

    def read(self, until_ns: int) -> Chunk | None:
        """See Port."""
        return self._port.read(until_ns)

    def write(self, data: bytes) -> None:
        """See Port."""
        self._port.write(data)

    def set_baud(self, baud: int) -> None:
        """See Port."""
        self._port.set_baud(baud)

    def reopen(self, until_ns: int) -> None:
        """See Port; a board that was off has forgotten the bridge."""
        self._port.reopen(until_ns)
        self.revive(until_ns)

    def revive(self, until_ns: int) -> None:
        """Paste the bridge again: a board that was reset shows its REPL."""
        repl = RawRepl(self._port, _farewell())
        repl.enter(until_ns)
        repl.run(f"{reduced(PROGRAM.read_text(encoding='utf-8'))}\nmain({self._pins!r})\n")

    def close(self) -> None:
        """End the bridge, and leave the board as it was before: its own programs start anew."""
        with suppress(BusError):
            self.write(_farewell())
            RawRepl(self._port, b"").leave()
        self._port.close()


def reduced(text: str) -> str:
    """A program without its comments and docstrings, which take a board's memory."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)


def _farewell() -> bytes:
    """What ends a bridge that runs, greeted or not."""
    return DELIMITER + b"".join(Frame(each.TYPE, 0, each.payload()).encode() for each in (Hello(), Leave()))
