"""Emulated Arduino Uno with a chip on its I2C bus. It knows no firmware, no protocol and no real time."""

import ctypes
import subprocess
from enum import IntEnum
from pathlib import Path

from mpucal.chip.access import Bus

CPU_HZ = 16_000_000
EEPROM_BYTES = 1024
LIBRARY = "board.so"
BUFFER_BYTES = 1 << 16

CHIP_READ = ctypes.CFUNCTYPE(ctypes.c_uint8, ctypes.c_uint8, ctypes.c_uint64)
CHIP_WRITE = ctypes.CFUNCTYPE(None, ctypes.c_uint8, ctypes.c_uint8, ctypes.c_uint64)


class Fault(IntEnum):
    """Fault of the chip, as in board.c."""

    SOUND, NO_ADDRESS, NO_DATA, HOLDS_BUS = range(4)


def compile_library(folder: Path) -> None:
    """Compile board.c into `folder`."""
    source = Path(__file__).with_name("board.c")
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I/usr/include/simavr"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(folder / LIBRARY), "-lsimavr", "-lelf"], check=True)


def load_library(folder: Path) -> ctypes.CDLL:
    """Load the library that was compiled into `folder`."""
    loaded = ctypes.CDLL(str(folder / LIBRARY))
    board, u8, u32, u64 = ctypes.c_void_p, ctypes.c_uint8, ctypes.c_uint32, ctypes.c_uint64
    prototypes = {
        "board_open": (board, [ctypes.c_char_p, ctypes.c_char_p, CHIP_READ, CHIP_WRITE]),
        "board_run": (ctypes.c_int, [board, u64]),
        "board_cycle": (u64, [board]),
        "board_send": (u32, [board, ctypes.c_char_p, u32]),
        "board_receive": (u32, [board, ctypes.c_char_p, u32]),
        "board_fault": (None, [board, u8]),
        "board_poke": (None, [board, ctypes.c_uint16, u8]),
        "board_overruns": (u32, [board]),
        "board_close": (None, [board, u8]),
    }
    for name, (result, arguments) in prototypes.items():
        getattr(loaded, name).restype, getattr(loaded, name).argtypes = result, arguments
    return loaded


class BoardClock:
    """Clock of the chip: the begin of the present transfer on the board's clock."""

    def __init__(self) -> None:
        self.cycle = 0

    def now(self) -> int:
        """Return ns since the board was switched on."""
        return self.cycle * 1_000_000_000 // CPU_HZ

    def spend(self, ns: int) -> None:
        """Do nothing: the board has taken the time already."""

    def sleep_until(self, t_ns: int) -> None:
        """Do nothing: the chip never sleeps."""


class Board:
    """Board that was just switched on; its time passes only while it runs.

    Parameters
    ----------
    library : from load_library. elf : the firmware. eeprom : its file, created if it is missing.
    chip : on its TWI, with the time of `clock`.
    """

    def __init__(self, library: ctypes.CDLL, elf: Path, eeprom: Path, chip: Bus, clock: BoardClock) -> None:
        if not eeprom.exists():
            eeprom.write_bytes(b"\xff" * EEPROM_BYTES)
        self._library, self._chip, self._clock = library, chip, clock
        # references that the library needs
        self._callbacks = CHIP_READ(self._read), CHIP_WRITE(self._write)
        self._board = library.board_open(str(elf).encode(), str(eeprom).encode(), *self._callbacks)
        if not self._board:
            raise OSError(f"cannot use {elf} or {eeprom}")
        self._buffer = ctypes.create_string_buffer(BUFFER_BYTES)

    @property
    def cycle(self) -> int:
        """Cycles of the processor since it was switched on."""
        return self._library.board_cycle(self._board)

    @property
    def now_s(self) -> float:
        """Seconds since it was switched on."""
        return self.cycle / CPU_HZ

    @property
    def overruns(self) -> int:
        """Bytes lost on the line because they were not read in time."""
        return self._library.board_overruns(self._board)

    def run(self, seconds: float) -> None:
        """Run the board for some seconds."""
        self.run_cycles(round(seconds * CPU_HZ))

    def run_cycles(self, cycles: int) -> None:
        """Run the board for some cycles."""
        if not self._library.board_run(self._board, self.cycle + cycles):
            raise RuntimeError(f"the processor crashed at cycle {self.cycle}")
        self._clock.cycle = self.cycle

    def send(self, data: bytes) -> int:
        """Send bytes to the board; return the number that fitted."""
        return self._library.board_send(self._board, data, len(data))

    def receive(self) -> bytes:
        """Return the bytes that the board has sent since the last call."""
        count = self._library.board_receive(self._board, self._buffer, BUFFER_BYTES)
        return self._buffer.raw[:count]

    def fault(self, fault: Fault) -> None:
        """Give the chip a fault from now on."""
        self._library.board_fault(self._board, fault)

    def poke(self, address: int, value: int) -> None:
        """Write a register of the processor, as a fault may do."""
        self._library.board_poke(self._board, address, value)

    def cut_power(self, torn: int = 0xFF) -> None:
        """Switch the board off; a byte that is being written to the EEPROM becomes `torn`."""
        if self._board:
            self._library.board_close(self._board, torn)
            self._board = None

    def _read(self, address: int, cycle: int) -> int:
        self._clock.cycle = cycle
        return self._chip.read(address, 1).data[0]

    def _write(self, address: int, value: int, cycle: int) -> None:
        self._clock.cycle = cycle
        self._chip.write(address, bytes([value]))
