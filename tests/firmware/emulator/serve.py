"""Emulated Uno on a pseudo terminal: a program that prints the terminal's name and runs the board until Ctrl-C.

python tests/firmware/emulator/serve.py mpucal/firmware/build/mpucal_bridge.elf eeprom.bin sim:seed=1
"""

import os
import sys
import tempfile
import time
import tty
from contextlib import suppress
from pathlib import Path

from mpucal.simulated.chip import open_simulated

sys.path.insert(0, str(Path(__file__).parent))
from board import Board, BoardClock, compile_library, load_library

STEP_S = 0.001


def main(elf: str, eeprom: str, chip: str = "sim") -> None:
    """Run the board in the time of this machine, with the chip that `chip` names as mpucal's --bus does."""
    here, there = os.openpty()
    tty.setraw(there)
    os.set_blocking(here, False)
    clock = BoardClock()
    with tempfile.TemporaryDirectory() as folder:
        compile_library(Path(folder))
        board = Board(load_library(Path(folder)), Path(elf), Path(eeprom), open_simulated(chip, clock=clock), clock)
        print(os.ttyname(there), flush=True)
        began_s = time.monotonic()
        while True:
            with suppress(BlockingIOError):
                board.send(os.read(here, 4096))
            board.run(STEP_S)
            with suppress(BlockingIOError):  # nobody reads
                os.write(here, board.receive())
            time.sleep(max(0.0, board.now_s - (time.monotonic() - began_s)))


if __name__ == "__main__":
    main(*sys.argv[1:])
