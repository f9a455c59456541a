"""Port to a board with MicroPython: the bridge is pasted into its REPL, and runs until the port is closed."""

from __future__ import annotations

import ast
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from ..errors import BusError
from .bus import RECOVER_NS
from .frame import DELIMITER, Frame
from .messages import Hello, Leave
from .port import BAUDS, Port, SerialPort
from .repl import RawRepl

PROGRAM = Path(__file__).with_name("board.py")


class MicroPythonPort:
    """Port to a bridge that runs on MicroPython; see Port.

    Parameters
    ----------
    text : PORT[:BAUD], or a URL; or an open port. pins : SDA and SCL, numbers or names; empty: the board's own.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, no MicroPython there, or one that cannot run the bridge.
    """

    def __init__(self, text: str | Port, pins: tuple[int | str, ...] = ()) -> None:
        # The slower one is that of a REPL on a UART; on USB it has no effect.
        self._port: Port = SerialPort(text, BAUDS[1:]) if isinstance(text, str) else text
        self.name, self.bauds = self._port.name, self._port.bauds[:1]
        self._pins = tuple(pins)
        self.now_ns, self.read, self.write = self._port.now_ns, self._port.read, self._port.write
        self.set_baud = self._port.set_baud
        try:
            self.revive(self.now_ns() + RECOVER_NS)
        except BaseException:
            self._port.close()
            raise

    def reopen(self, until_ns: int) -> None:
        """Open the port again and restart the bridge, which a board that was off has lost."""
        self._port.reopen(until_ns)
        self.revive(until_ns)

    def revive(self, until_ns: int) -> None:
        """Paste the bridge again, since a board that was reset shows its REPL."""
        repl = RawRepl(self._port, _leave_bytes())
        repl.enter(until_ns)
        repl.run(f"{minify(PROGRAM.read_text(encoding='utf-8'))}\nmain({self._pins!r})\n")

    def close(self) -> None:
        """End the bridge, and restart the board's own programs."""
        with suppress(BusError):
            self.write(_leave_bytes())
            RawRepl(self._port, b"").leave()
        self._port.close()


def minify(text: str) -> str:
    """Return a program for a board: without docstrings and comments, which take memory, and imports from mpucal."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    tree.body = [line for node in tree.body for line in _inlined(node)]
    return ast.unparse(tree)


def _inlined(node: ast.stmt) -> list[ast.stmt]:
    """Return a statement; in place of an import from mpucal, the numbers, or enumerations of them, that it imports."""
    if not isinstance(node, ast.ImportFrom) or not node.level:
        return [node]
    module = vars(import_module("." * node.level + str(node.module), __package__))
    lines = []
    for name, value in ((each.name, module[each.name]) for each in node.names):
        members = getattr(value, "__members__", None)
        lines += [f"{name} = {value!r}"] if members is None else [f"class {name}:"]
        lines += [f"    {member} = {number:d}" for member, number in (members or {}).items()]
    return ast.parse("\n".join(lines)).body


def _leave_bytes() -> bytes:
    """Return the bytes that end a running bridge, greeted or not."""
    return DELIMITER + b"".join(Frame(each.TYPE, 0, each.payload()).encode() for each in (Hello(), Leave()))
