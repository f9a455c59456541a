"""Firmware's core compiled for this machine, with a simulated processor."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[3]
SOURCES = ROOT / "mpucal" / "firmware" / "src"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
CORE = "core.so"
SANITIZE = "MPUCAL_SANITIZE"
SANITIZERS = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

U8, U16, U32 = ctypes.c_uint8, ctypes.c_uint16, ctypes.c_uint32
BYTES = ctypes.POINTER(U8)


class Memory(ctypes.Structure):
    """struct mpucal_memory."""

    READ = ctypes.CFUNCTYPE(U8, U16)
    WRITE = ctypes.CFUNCTYPE(None, U16, U8)
    COMMIT = ctypes.CFUNCTYPE(None)
    _fields_ = (("read", READ), ("write", WRITE), ("commit", COMMIT))


class Port(ctypes.Structure):
    """struct mpucal_port."""

    TRANSFER = ctypes.CFUNCTYPE(U8, U8, U8, BYTES, U8)
    NOW_US = ctypes.CFUNCTYPE(U32)
    SEND = ctypes.CFUNCTYPE(None, BYTES, U8)
    _fields_ = (
        ("read_registers", TRANSFER),
        ("write_registers", TRANSFER),
        ("now_us", NOW_US),
        ("send", SEND),
        ("memory", ctypes.POINTER(Memory)),
        ("window", U8),
        ("name", ctypes.c_char_p),
    )


class Stored(ctypes.Structure):
    """struct mpucal_stored."""

    _fields_ = (("generation", U32), ("at", U16), ("length", U16))


def compile_core(folder: Path) -> None:
    """Compile the core into `folder`, with the sanitizers if the environment asks for them."""
    flags = SANITIZERS if SANITIZE in os.environ else ["-O1"]
    sources = [*sorted(SOURCES.glob("*.c")), Path(__file__).with_name("host.c")]
    command = ["gcc", "-std=c99", *WARNINGS, *flags, f"-I{SOURCES}", "-fPIC", "-shared", "-o", str(folder / CORE)]
    subprocess.run([*command, *map(str, sources)], check=True)


def load_core(folder: Path) -> ctypes.CDLL:
    """Load the core that was compiled into `folder`."""
    core = ctypes.CDLL(str(folder / CORE))
    core.mpucal_slots_stored.restype = Stored
    core.mpucal_slots_open.restype = U16
    core.mpucal_slots_seal.restype = U32
    for name in ("mpucal_frame_open", "mpucal_frame_close", "mpucal_frame_receive"):
        getattr(core, name).restype = U8
    core.host_accepted.argtypes, core.host_accepted.restype = [ctypes.c_uint64, U32], U32
    return core


class Eeprom:
    """Memory of 1 KiB whose power fails at write number `cut_at`, which leaves `torn` in the byte."""

    def __init__(self, content: bytes = b"\xff" * 1024, cut_at: int | None = None, torn: int = 0) -> None:
        self.content = bytearray(content)
        self.writes = 0
        self.stuck: set[int] = set()
        self._cut_at, self._torn = cut_at, torn
        self.is_off = False
        self.memory = Memory(Memory.READ(self._read), Memory.WRITE(self._write), Memory.COMMIT())

    def _read(self, address: int) -> int:
        return self.content[address]

    def _write(self, address: int, value: int) -> None:
        # An exception cannot pass through C: without power the memory ignores writes.
        if self.is_off or address in self.stuck:
            return
        if self.writes == self._cut_at:
            self.is_off = True
            value = self._torn
        self.content[address] = value
        self.writes += 1


class HostBridge:
    """Bridge's core on this machine.

    Parameters
    ----------
    core : from load_core. eeprom : its memory. read, write : registers, as (address, first, data or count) to
    (code, data) or a code.

    Attributes
    ----------
    now_us : its clock. sent : bytes that it has sent and that were not taken yet.
    """

    def __init__(
        self,
        core: ctypes.CDLL,
        eeprom: Eeprom,
        read: Callable[[int, int, int], tuple[int, bytes]],
        write: Callable[[int, int, bytes], int],
    ) -> None:
        self._core, self._eeprom, self._read, self._write = core, eeprom, read, write
        self.now_us = 0
        self.sent = bytearray()
        self._port = Port(
            Port.TRANSFER(self._read_registers),
            Port.TRANSFER(lambda address, first, data, count: self._write(address, first, bytes(data[:count]))),
            Port.NOW_US(lambda: self.now_us),
            Port.SEND(lambda data, count: self.sent.extend(data[:count])),
            ctypes.pointer(eeprom.memory),
            3,
            b"core on a host",
        )
        self._bridge = ctypes.create_string_buffer(core.host_bridge_bytes())
        core.mpucal_bridge_begin(self._bridge, ctypes.byref(self._port))

    def receive(self, data: bytes) -> bytes:
        """Pass `data` to the bridge, and return the bytes that it sends."""
        for byte in data:
            self._core.mpucal_bridge_receive(self._bridge, byte)
        return self._take()

    def look(self) -> bytes:
        """Call the bridge's look at the FIFO, and return the bytes that it sends."""
        self._core.mpucal_bridge_look(self._bridge)
        return self._take()

    def _take(self) -> bytes:
        sent, self.sent = bytes(self.sent), bytearray()
        return sent

    def _read_registers(self, address: int, first: int, data: ctypes._Pointer[U8], count: int) -> int:
        code, got = self._read(address, first, count)
        for i, byte in enumerate(got[:count]):
            data[i] = byte
        return code
