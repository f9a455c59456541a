"""MicroPython's raw REPL on a port: the running program is interrupted, and another pasted and started.

Source: MicroPython's documentation, "The MicroPython Interactive Interpreter Mode", raw mode and raw-paste mode.
"""

from __future__ import annotations

from contextlib import suppress

from ..errors import BusError
from .link import MS
from .port import Port

CTRL_A, CTRL_B, CTRL_C, CTRL_D = b"\x01", b"\x02", b"\x03", b"\x04"
BANNER = b"raw REPL; CTRL-B to exit\r\n>"
REBOOT = b"soft reboot\r\n"
RAW_PASTE, PASTE_ACCEPTED = b"\x05A\x01", b"R\x01"
WINDOW_FREED = 0x01

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
                if self._read(1)[0] != WINDOW_FREED:
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
