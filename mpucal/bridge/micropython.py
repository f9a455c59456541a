"""Port to a board with MicroPython: the bridge is pasted into its raw REPL, and runs until the port is closed.

Source: MicroPython's documentation, "The MicroPython Interactive Interpreter Mode", raw mode and raw-paste mode.
"""

from __future__ import annotations

import ast
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from ..clocks import MS
from ..errors import BusError
from .bus import RECOVER_NS
from .frame import DELIMITER, Frame
from .messages import Hello, Leave
from .port import BAUDS, Port, SerialPort

CTRL_A, CTRL_B, CTRL_C, CTRL_D = b"\x01", b"\x02", b"\x03", b"\x04"
BANNER = b"raw REPL; CTRL-B to exit\r\n>"
REBOOT = b"soft reboot\r\n"
RAW_PASTE, PASTE_ACCEPTED, WINDOW_FREED = b"\x05A\x01", b"R\x01", b"\x01"

# The last one is for a boot, and for a program to be compiled.
ASK_NS, ANSWER_NS, BOOT_NS = 1000 * MS, 2000 * MS, 15_000 * MS


class NoRepl(BusError):  # noqa: N818 - reads as the sentence it is
    """Error of a port on which no raw REPL answers."""


class RawRepl:
    """REPL on an open `port`.

    Parameters
    ----------
    escape : bytes that end a program which ignores Ctrl-C: a bridge left running by a host that was killed.
    """

    def __init__(self, port: Port, escape: bytes) -> None:
        self._port, self._escape = port, escape
        self._received = bytearray()

    def enter(self, until_ns: int) -> None:
        """Interrupt the running program and make a soft reset, which removes its timers, interrupts and memory.

        Raises
        ------
        NoRepl : no REPL answers until the host's clock shows `until_ns`. BusError : the port is gone.
        """
        while not self._interrupted():
            if self._port.now_ns() >= until_ns:
                raise NoRepl(
                    f"no MicroPython answers on {self._port.name}",
                    "press the board's reset button, then try again; a board with the bridge's firmware needs no "
                    "--micropython",
                )
            self._port.write(self._escape)
        self._port.write(CTRL_D)
        self._expect(REBOOT, ANSWER_NS)
        if not self._wait_for(BANNER, BOOT_NS):
            # A boot.py that never ends is interrupted.
            self._port.write(b"\r" + CTRL_C + CTRL_C + b"\r" + CTRL_A)
            self._expect(BANNER, ANSWER_NS)

    def run(self, program: str) -> None:
        """Start `program`, which sends a zero byte once it runs.

        Raises
        ------
        BusError : the program ends before that, or the board does not accept it.
        """
        self._port.write(RAW_PASTE)
        if self._read(2) != PASTE_ACCEPTED:
            raise self._does_not_run("it knows no raw-paste mode")
        self._paste(program.encode())
        until_ns = self._port.now_ns() + BOOT_NS
        while b"\0" not in self._received:
            ended = self._received.count(CTRL_D) >= 2
            if ended or not self._receive(until_ns):
                words = self._received.replace(CTRL_D, b"\n").decode("ascii", "replace").split("\n")
                why = next((line.strip() for line in reversed(words) if len(line.strip()) > 1), "no output")
                raise self._does_not_run(why)
        del self._received[: self._received.index(b"\0") + 1]

    def leave(self) -> None:
        """Restart the board after the program has ended, as at power-on, with its own main.py."""
        with suppress(BusError):
            self._wait_for(CTRL_D + b">", ASK_NS)
            self._port.write(CTRL_B + CTRL_D)
            self._wait_for(REBOOT, ANSWER_NS)

    def _interrupted(self) -> bool:
        """Send Ctrl-C; return True if the raw REPL shows its banner."""
        self._port.write(b"\r" + CTRL_C + CTRL_C)
        quiet_ns = self._port.now_ns() + ASK_NS // 4
        while self._receive(quiet_ns):
            continue
        self._received.clear()
        self._port.write(b"\r" + CTRL_A)
        return self._wait_for(BANNER, ASK_NS)

    def _paste(self, text: bytes) -> None:
        """Send `text` in the pieces for which the board announces room."""
        step = room = int.from_bytes(self._read(2), "little")
        at = 0
        while at < len(text):
            while self._received or not room:
                if self._read(1) != WINDOW_FREED:
                    # The board rejects the program; the error follows.
                    self._port.write(CTRL_D)
                    return
                room += step
            self._port.write(text[at : at + room])
            at += room
            room = 0
        self._port.write(CTRL_D)
        self._expect(CTRL_D, BOOT_NS)

    def _expect(self, words: bytes, within_ns: int) -> None:
        """Wait for `words`, and drop everything up to their end."""
        if not self._wait_for(words, within_ns):
            raise self._silent()

    def _wait_for(self, words: bytes, within_ns: int) -> bool:
        until_ns = self._port.now_ns() + within_ns
        while words not in self._received:
            if not self._receive(until_ns):
                return False
        del self._received[: self._received.index(words) + len(words)]
        return True

    def _read(self, count: int) -> bytes:
        until_ns = self._port.now_ns() + ANSWER_NS
        while len(self._received) < count:
            if not self._receive(until_ns):
                raise self._silent()
        data = bytes(self._received[:count])
        del self._received[:count]
        return data

    def _does_not_run(self, why: str) -> BusError:
        what = f"MicroPython on {self._port.name} does not run the bridge ({why})"
        return BusError(what, "install MicroPython 1.20 or later, or use a board with more memory")

    def _silent(self) -> NoRepl:
        return NoRepl(f"MicroPython on {self._port.name} stopped answering", "press its reset button, and try again")

    def _receive(self, until_ns: int) -> bool:
        chunk = self._port.read(until_ns)
        if chunk is not None:
            self._received += chunk.data
        return chunk is not None


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
