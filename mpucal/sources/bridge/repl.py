"""MicroPython's raw REPL on a port: a program that runs is interrupted, and another pasted and started.

Source: MicroPython's documentation, "The MicroPython Interactive Interpreter Mode", raw mode and raw-paste mode.
"""

from __future__ import annotations

from contextlib import suppress

from ...errors import BusError
from .port import Port

CTRL_A, CTRL_B, CTRL_C, CTRL_D = b"\x01", b"\x02", b"\x03", b"\x04"
BANNER = b"raw REPL; CTRL-B to exit\r\n>"
REBOOT = b"soft reboot\r\n"
RAW_PASTE, TAKEN, NOT_HERE = b"\x05A\x01", b"R\x01", b"R\x00"
MORE = 0x01
STARTED = b"OK"
# of a board whose UART has no flow control
PIECE_BYTES, PIECE_NS = 128, 10_000_000

S = 1_000_000_000
ASK_NS, ANSWER_NS, BOOT_NS, COMPILE_NS = S, 2 * S, 15 * S, 10 * S


class NoRepl(BusError):  # noqa: N818 - reads as the sentence it is
    """No raw REPL answers."""


class RawRepl:
    """The REPL on `port`, which is open.

    Parameters
    ----------
    escape : what ends a program there that takes no Ctrl-C: the bridge, left by a host that was killed.
    """

    def __init__(self, port: Port, escape: bytes) -> None:
        self._port, self._escape = port, escape
        self._heard = bytearray()

    def enter(self, until_ns: int) -> None:
        """Interrupt what runs, and begin anew: its timers, interrupts and memory are gone after a soft reset.

        Raises
        ------
        NoRepl : none answers until the host's clock shows `until_ns`. BusError : the port is gone.
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
        self._take(REBOOT, ANSWER_NS)
        if not self._came(BANNER, BOOT_NS):
            # a boot.py that never ends
            self._port.write(b"\r" + CTRL_C + CTRL_C + b"\r" + CTRL_A)
            self._take(BANNER, ANSWER_NS)

    def run(self, program: str) -> None:
        """Start `program`; it says a zero byte once it runs.

        Raises
        ------
        BusError : it ends before that, or the board does not take it.
        """
        text = program.encode()
        self._port.write(RAW_PASTE)
        self._fill(2, ANSWER_NS)
        answer = self._cut(2)
        if answer == TAKEN:
            self._paste(text)
        else:
            if answer != NOT_HERE:
                # before MicroPython 1.14 it takes the request for a line, and says its banner
                self._take(b"\n>", ANSWER_NS)
            self._type(text)
        until_ns = self._port.now_ns() + COMPILE_NS
        while b"\0" not in self._heard:
            ended = self._heard.count(CTRL_D) >= 2
            if ended or not self._listen(until_ns):
                words = self._heard.replace(CTRL_D, b"\n").decode("ascii", "replace").split("\n")
                why = next((line.strip() for line in reversed(words) if len(line.strip()) > 1), "it says nothing")
                raise BusError(
                    f"MicroPython on {self._port.name} does not run the bridge ({why})",
                    "put a MicroPython of 1.20 or later on the board, or one with more memory",
                )
        del self._heard[: self._heard.index(b"\0") + 1]

    def leave(self) -> None:
        """After the program has ended: begin anew, as after power-on, with the board's own main.py."""
        with suppress(BusError):
            self._came(CTRL_D + b">", ASK_NS)
            self._port.write(CTRL_B + CTRL_D)
            self._came(REBOOT, ANSWER_NS)

    def _interrupted(self) -> bool:
        """Whether the raw REPL says its banner after Ctrl-C."""
        self._port.write(b"\r" + CTRL_C + CTRL_C)
        quiet_ns = self._port.now_ns() + ASK_NS // 4
        while self._listen(quiet_ns):
            continue
        self._heard.clear()
        self._port.write(b"\r" + CTRL_A)
        return self._came(BANNER, ASK_NS)

    def _paste(self, text: bytes) -> None:
        """As much at once as the board says that it has room for."""
        self._fill(2, ANSWER_NS)
        step = room = int.from_bytes(self._cut(2), "little")
        at = 0
        while at < len(text):
            while self._heard or not room:
                self._fill(1, ANSWER_NS)
                if self._cut(1)[0] != MORE:
                    # it has seen enough: what is wrong comes next
                    self._port.write(CTRL_D)
                    return
                room += step
            self._port.write(text[at : at + room])
            at += room
            room = 0
        self._port.write(CTRL_D)
        self._take(CTRL_D, COMPILE_NS)

    def _type(self, text: bytes) -> None:
        for at in range(0, len(text), PIECE_BYTES):
            self._port.write(text[at : at + PIECE_BYTES])
            self._listen(self._port.now_ns() + PIECE_NS)
        self._port.write(CTRL_D)
        self._take(STARTED, COMPILE_NS)

    def _take(self, words: bytes, within_ns: int) -> None:
        """Wait for `words`, and drop what came up to their end."""
        if not self._came(words, within_ns):
            raise NoRepl(f"MicroPython on {self._port.name} stopped answering", "press its reset button, and try again")

    def _came(self, words: bytes, within_ns: int) -> bool:
        until_ns = self._port.now_ns() + within_ns
        while words not in self._heard:
            if not self._listen(until_ns):
                return False
        del self._heard[: self._heard.index(words) + len(words)]
        return True

    def _fill(self, count: int, within_ns: int) -> None:
        until_ns = self._port.now_ns() + within_ns
        while len(self._heard) < count:
            if not self._listen(until_ns):
                raise NoRepl(
                    f"MicroPython on {self._port.name} stopped answering", "press its reset button, and try again"
                )

    def _cut(self, count: int) -> bytes:
        taken = bytes(self._heard[:count])
        del self._heard[:count]
        return taken

    def _listen(self, until_ns: int) -> bool:
        chunk = self._port.read(until_ns)
        if chunk is not None:
            self._heard += chunk.data
        return chunk is not None
