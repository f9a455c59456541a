"""Emulated Uno on a pseudo terminal: a program that prints the terminal's name and runs the board.

    python tests/firmware/emulator/serve.py mpucal/firmware/build/mpucal_bridge.elf eeprom.bin --chip sim:seed=1

The board is switched off when stdin ends. Lines on stdin are the output of `mpucal session --json-events`, for the
simulated hand that holds the chip.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import sys
import tempfile
import time
import tty
from collections.abc import Callable
from pathlib import Path

from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated

sys.path.insert(0, str(Path(__file__).parent))
from board import Board, BoardClock, compile_library, load_library

STEP_S = 0.001
CHUNK_BYTES = 4096


class Terminal:
    """Board's end of a pseudo terminal, which never blocks."""

    def __init__(self) -> None:
        self._end, others = os.openpty()
        tty.setraw(others)
        self.name = os.ttyname(others)
        os.close(others)
        os.set_blocking(self._end, False)
        self._poll = select.poll()
        self._poll.register(self._end, 0)

    @property
    def is_open(self) -> bool:
        """True if a program has opened the other end."""
        return not any(events & select.POLLHUP for _, events in self._poll.poll(0))

    def read(self) -> bytes:
        """Return the bytes written to the other end."""
        try:
            return os.read(self._end, CHUNK_BYTES)
        except OSError:
            return b""

    def write(self, data: bytes) -> bytes:
        """Write `data`, and return the part that did not fit."""
        try:
            return data[os.write(self._end, data) :] if data else b""
        except BlockingIOError:
            return data


class Served:
    """Board with a terminal as its USB port: opening it resets the board, as on an Arduino.

    Parameters
    ----------
    bootloader_s : time in which a bootloader takes all bytes after a reset.
    """

    def __init__(self, board: Board, terminal: Terminal, bootloader_s: float) -> None:
        self._board, self._terminal, self._bootloader_s = board, terminal, bootloader_s
        self._was_open = False
        self._booted_s = 0.0
        self._unsent = b""

    def step(self) -> None:
        """Run the board for a step, but not while the computer does not read its bytes."""
        is_open = self._terminal.is_open
        if is_open and not self._was_open:
            self._booted_s = self._board.now_s + self._bootloader_s
        self._was_open = is_open
        self._unsent = self._terminal.write(self._unsent)
        if self._unsent and is_open:
            time.sleep(STEP_S)
            return
        self._board.send(self._terminal.read())
        self._board.run(STEP_S)
        self._unsent = self._board.receive()
        if self._board.now_s < self._booted_s:
            self._board.press_reset()
            self._unsent = b""


def listener(tell: Callable[[Prompt], None]) -> Callable[[], bool]:
    """Return a function that passes on the prompts from stdin; it returns False once stdin has ended."""
    os.set_blocking(sys.stdin.fileno(), False)
    rest = b""

    def listen() -> bool:
        nonlocal rest
        try:
            data = os.read(sys.stdin.fileno(), CHUNK_BYTES)
        except BlockingIOError:
            return True
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            event = json.loads(line) if line.startswith(b"{") else {}
            if event.get("event") == "prompt":
                down = event["down"] and tuple(event["down"])
                tell(Prompt(PromptKind(event["kind"]), event["text"], down))
        return bool(data)

    return listen


def main() -> None:
    """Run until stdin ends."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("elf", type=Path)
    parser.add_argument("eeprom", type=Path, help="the file that holds its bytes; made where it is missing")
    parser.add_argument("--chip", default="sim", help="as mpucal's --bus takes it")
    parser.add_argument("--pace", type=float, default=1.0, help="seconds of the board in one of the clock, at most")
    parser.add_argument("--bootloader", type=float, default=1.6, metavar="SECONDS")
    options = parser.parse_args()
    clock = BoardClock()
    chip = open_simulated(options.chip, clock=clock)
    listen = listener(chip.hear)
    with tempfile.TemporaryDirectory() as folder:
        compile_library(Path(folder))
        with Board(load_library(Path(folder)), options.elf, options.eeprom, chip, clock) as board:
            terminal = Terminal()
            print(terminal.name, flush=True)
            served = Served(board, terminal, options.bootloader)
            began_s = time.monotonic()
            while listen():
                served.step()
                ahead_s = board.now_s / options.pace - (time.monotonic() - began_s)
                # even a sleep of no time gives the processor away
                if ahead_s > 0:
                    time.sleep(ahead_s)


if __name__ == "__main__":
    main()
