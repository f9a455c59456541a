"""The two slots of an emulated bridge's memory; see firmware_protocol.md, "Storage"."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ...result.blob import LENGTH_AT, MAGIC, MAX_LENGTH, Blob, BlobError

HEADER = struct.Struct("<I I")
SLOT_BYTES = HEADER.size + MAX_LENGTH
MEMORY_BYTES = 2 * SLOT_BYTES
WRAP = 2**32


class Memory:
    """Bytes that stay through power-off; they are written one after the other."""

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * MEMORY_BYTES)

    def write(self, at: int, data: bytes) -> None:
        """Write `data` at `at`."""
        self.data[at : at + len(data)] = data


@dataclass(frozen=True)
class Stored:
    """A valid slot."""

    slot: int
    generation: int
    blob: bytes


class SlotStorage:
    """One blob in a memory, old or new whenever the power goes."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def stored(self) -> Stored | None:
        """The valid slot, the later one of two."""
        slots = [slot for slot in (self._slot(0), self._slot(1)) if slot is not None]
        if len(slots) == 2 and (slots[1].generation - slots[0].generation) % WRAP < WRAP // 2:
            return slots[1]
        return slots[0] if slots else None

    @property
    def occupied(self) -> bool:
        """Whether a slot holds what is neither a blob nor erased."""
        slots = [bytes(self._memory.data[at : at + SLOT_BYTES]) for at in (0, SLOT_BYTES)]
        return any(not slot[HEADER.size :].startswith(MAGIC) and len(set(slot)) > 1 for slot in slots)

    def begin(self) -> None:
        """Make the slot that is not in use free to be written."""
        self._spoil(self._other())

    def write(self, offset: int, data: bytes) -> None:
        """Write `data` there."""
        self._memory.write(self._other() * SLOT_BYTES + HEADER.size + offset, data)

    def written(self, length: int) -> bytes:
        """The first `length` bytes there."""
        at = self._other() * SLOT_BYTES + HEADER.size
        return bytes(self._memory.data[at : at + length])

    def commit(self) -> int:
        """Let what was written there be the blob; returns its generation."""
        stored, slot = self.stored(), self._other()
        generation = (stored.generation + 1) % WRAP if stored else 1
        header = HEADER.pack(generation, generation ^ (WRAP - 1))
        self._memory.write(slot * SLOT_BYTES, header[:4])
        self._memory.write(slot * SLOT_BYTES + 4, header[4:])
        return generation

    def erase(self) -> None:
        """Store none."""
        other = self._other()
        self._spoil(other)
        self._spoil(1 - other)

    def _other(self) -> int:
        stored = self.stored()
        return 1 - stored.slot if stored else 0

    def _spoil(self, slot: int) -> None:
        at = slot * SLOT_BYTES
        (generation,) = struct.unpack_from("<I", self._memory.data, at)
        self._memory.write(at + 4, struct.pack("<I", generation))

    def _slot(self, slot: int) -> Stored | None:
        data = bytes(self._memory.data[slot * SLOT_BYTES : (slot + 1) * SLOT_BYTES])
        generation, check = HEADER.unpack_from(data)
        body = data[HEADER.size :]
        blob = body[: int.from_bytes(body[LENGTH_AT : LENGTH_AT + 2], "little")]
        if generation ^ check != WRAP - 1 or not is_valid_blob(blob):
            return None
        return Stored(slot, generation, blob)


def is_valid_blob(blob: bytes) -> bool:
    """Whether a reader may accept it."""
    try:
        Blob.decode(blob)
    except BlobError:
        return False
    return True


def crc_of(blob: bytes) -> int:
    """Its CRC-32, its last four bytes."""
    return int.from_bytes(blob[-4:], "little")
