"""Two slots of an emulated bridge's memory; see firmware_protocol.md, "Storage"."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ...result.blob import LENGTH_AT, MAGIC, MAX_LENGTH, Blob, BlobError

HEADER = struct.Struct("<I I")
SLOT_BYTES = HEADER.size + MAX_LENGTH
MEMORY_BYTES = 2 * SLOT_BYTES
WRAP = 2**32


class Memory:
    """Non-volatile bytes, written one after the other."""

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * MEMORY_BYTES)

    def write(self, at: int, data: bytes) -> None:
        """Write `data` from address `at` on."""
        self.data[at : at + len(data)] = data


@dataclass(frozen=True)
class Stored:
    """Content of a valid slot."""

    slot: int
    generation: int
    blob: bytes


class SlotStorage:
    """Storage of one blob, which is the old or the new one whenever power is lost."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def stored(self) -> Stored | None:
        """Return the valid slot, the later one of two; None if there is none."""
        slots = [slot for slot in (self._slot(0), self._slot(1)) if slot is not None]
        if len(slots) == 2 and (slots[1].generation - slots[0].generation) % WRAP < WRAP // 2:
            return slots[1]
        return slots[0] if slots else None

    @property
    def occupied(self) -> bool:
        """True if a slot holds bytes that are neither a blob nor erased."""
        slots = [bytes(self._memory.data[at : at + SLOT_BYTES]) for at in (0, SLOT_BYTES)]
        return any(not slot[HEADER.size :].startswith(MAGIC) and len(set(slot)) > 1 for slot in slots)

    def begin(self) -> None:
        """Invalidate the slot that is not in use."""
        self._claim(self._other())

    def write(self, offset: int, data: bytes) -> None:
        """Write `data` into the slot that is not in use."""
        self._memory.write(self._other() * SLOT_BYTES + HEADER.size + offset, data)

    def written(self, length: int) -> bytes:
        """Return the first `length` bytes of the slot that is not in use."""
        at = self._other() * SLOT_BYTES + HEADER.size
        return bytes(self._memory.data[at : at + length])

    def commit(self) -> int:
        """Make the written slot the valid one; return its generation."""
        stored, slot = self.stored(), self._other()
        generation = (stored.generation + 1) % WRAP if stored else 1
        header = HEADER.pack(generation, generation ^ (WRAP - 1))
        self._memory.write(slot * SLOT_BYTES, header[:4])
        self._memory.write(slot * SLOT_BYTES + 4, header[4:])
        return generation

    def erase(self) -> None:
        """Invalidate both slots."""
        other = self._other()
        self._claim(other)
        self._claim(1 - other)

    def _other(self) -> int:
        stored = self.stored()
        return 1 - stored.slot if stored else 0

    def _claim(self, slot: int) -> None:
        """Invalidate a slot, and begin it with the magic, so that it no longer looks like other data."""
        at = slot * SLOT_BYTES
        (generation,) = struct.unpack_from("<I", self._memory.data, at)
        self._memory.write(at + 4, struct.pack("<I", generation))
        self._memory.write(at + HEADER.size, MAGIC)

    def _slot(self, slot: int) -> Stored | None:
        data = bytes(self._memory.data[slot * SLOT_BYTES : (slot + 1) * SLOT_BYTES])
        generation, check = HEADER.unpack_from(data)
        body = data[HEADER.size :]
        blob = body[: int.from_bytes(body[LENGTH_AT : LENGTH_AT + 2], "little")]
        if generation ^ check != WRAP - 1 or not is_valid_blob(blob):
            return None
        return Stored(slot, generation, blob)


def is_valid_blob(blob: bytes) -> bool:
    """Return True if a reader accepts the blob."""
    try:
        Blob.decode(blob)
    except BlobError:
        return False
    return True


def crc_of(blob: bytes) -> int:
    """Return the CRC-32 in a blob's last four bytes."""
    return int.from_bytes(blob[-4:], "little")
