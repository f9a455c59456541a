"""Blob slots: one of the two is valid at any moment, even if the power fails."""

import ctypes
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.result.blob import Blob

VECTORS = Path(__file__).parents[2] / "fixtures" / "vectors"
SEAL_BYTES = 8
SLOT_BYTES = 264
MEASURED = Blob.decode((VECTORS / "blob_measured.bin").read_bytes())
OLD, NEW, NEWER = (replace(MEASURED, b_a=(float(i), 0.0, 0.0)).encode() for i in range(3))


@pytest.fixture(scope="module")
def slots(core):
    return Slots(core)


class Slots:
    """Calls of a blob write, as the bridge's messages make them."""

    def __init__(self, core):
        self._core = core

    def stored(self, eeprom):
        return self._core.mpucal_slots_stored(ctypes.byref(eeprom.memory))

    def read(self, eeprom):
        stored = self.stored(eeprom)
        return bytes(eeprom.content[stored.at : stored.at + stored.length]) if stored.generation else None

    def store(self, eeprom, blob):
        memory = ctypes.byref(eeprom.memory)
        at = self._core.mpucal_slots_open(memory)
        for i, byte in enumerate(blob):
            eeprom.memory.write(at + i, byte)
        crc = int.from_bytes(blob[-4:], "little")
        if not self._core.mpucal_slots_check(memory, at, len(blob), ctypes.c_uint32(crc)):
            return 0
        return self._core.mpucal_slots_seal(memory, at)

    def erase(self, eeprom):
        return self._core.mpucal_slots_erase(ctypes.byref(eeprom.memory))


def holding(host, slots, *blobs):
    eeprom = host.Eeprom()
    for blob in blobs:
        assert slots.store(eeprom, blob)
    return bytes(eeprom.content)


def test_slots_take_turns_and_lie_in_memory_as_the_protocol_says(host, slots):
    eeprom = host.Eeprom()
    assert slots.read(eeprom) is None
    found = [(slots.store(eeprom, blob), slots.stored(eeprom).at, slots.read(eeprom)) for blob in (OLD, NEW, NEWER)]
    assert found == [(1, SEAL_BYTES, OLD), (2, SLOT_BYTES + SEAL_BYTES, NEW), (3, SEAL_BYTES, NEWER)]
    first, second = eeprom.content[:SLOT_BYTES], eeprom.content[SLOT_BYTES:]
    assert first[:SEAL_BYTES] == bytes.fromhex("03000000fcffffff")
    assert second[: SEAL_BYTES + len(NEW)] == bytes.fromhex("02000000fdffffff") + NEW


def writes_of(host, slots, content, change):
    eeprom = host.Eeprom(content)
    change(eeprom)
    return eeprom.writes


@pytest.mark.parametrize(
    ("before", "torn"),
    [((), 0x5A), ((OLD,), 0xFF), ((NEWER, OLD), 0x00), ((NEWER, OLD), 0x5A)],
    ids=["none", "first slot", "both slots, 0", "both slots"],
)
def test_power_loss_at_any_write_leaves_the_old_blob_or_the_new_one(before, torn, host, slots):
    content = holding(host, slots, *before)
    old = before[-1] if before else None
    seen = set()
    for cut_at in range(writes_of(host, slots, content, lambda eeprom: slots.store(eeprom, NEW))):
        eeprom = host.Eeprom(content, cut_at, torn)
        slots.store(eeprom, NEW)
        after = host.Eeprom(eeprom.content)
        seen.add(slots.read(after))
        assert seen <= {old, NEW}
        # the remains do not prevent the next write
        assert slots.store(after, NEWER)
        assert slots.read(after) == NEWER
    assert old in seen


@settings(max_examples=40)
@given(cuts=st.lists(st.tuples(st.integers(0, 210), st.integers(0, 255)), min_size=1, max_size=5))
def test_repeated_power_losses_leave_a_blob_that_was_once_whole(cuts, host, slots):
    content, whole = holding(host, slots, OLD), OLD
    for number, (cut_at, torn) in enumerate(cuts):
        blob = replace(MEASURED, created="", b_a=(0.0, float(number), 1.0)).encode()
        eeprom = host.Eeprom(content, cut_at, torn)
        slots.store(eeprom, blob)
        content = bytes(eeprom.content)
        held = slots.read(host.Eeprom(content))
        assert held in (whole, blob)
        whole = held


def test_a_byte_that_does_not_keep_its_value_leaves_the_old_blob(host, slots):
    content = holding(host, slots, OLD)
    for stuck in range(SLOT_BYTES, SLOT_BYTES + SEAL_BYTES + len(NEW)):
        eeprom = host.Eeprom(content)
        eeprom.stuck.add(stuck)
        stored = slots.store(eeprom, NEW)
        # a byte that is stuck at its new value is no failure
        assert slots.read(eeprom) == (NEW if stored else OLD)


def test_a_blob_that_rotted_gives_way_to_the_one_before(host, slots):
    content = bytearray(holding(host, slots, OLD, NEW))
    content[SLOT_BYTES + SEAL_BYTES + 100] ^= 1
    eeprom = host.Eeprom(content)
    assert slots.read(eeprom) == OLD
    assert slots.store(eeprom, NEWER)
    assert (slots.read(eeprom), slots.stored(eeprom).at) == (NEWER, SLOT_BYTES + SEAL_BYTES)


@pytest.mark.parametrize("before", [(), (OLD,), (OLD, NEW)], ids=["none", "one", "two"])
def test_erased_is_erased_and_never_an_older_one(before, host, slots):
    content = holding(host, slots, *before)
    for cut_at in range(writes_of(host, slots, content, slots.erase)):
        eeprom = host.Eeprom(content, cut_at, 0x5A)
        slots.erase(eeprom)
        assert slots.read(host.Eeprom(eeprom.content)) in (before[-1] if before else None, None)
    eeprom = host.Eeprom(content)
    assert slots.erase(eeprom)
    assert slots.read(eeprom) is None


def test_somebody_elses_bytes_are_noticed_and_a_blobs_are_not(host, core, slots):
    def occupied(eeprom):
        return bool(core.mpucal_slots_occupied(ctypes.byref(eeprom.memory)))

    memory = ctypes.byref
    for erased in (b"\xff", b"\x00"):
        fresh = host.Eeprom(erased * 1024)
        assert not occupied(fresh)
        core.mpucal_slots_open(memory(fresh.memory))
        assert not occupied(fresh)
    held = host.Eeprom(holding(host, slots, OLD, NEW))
    assert not occupied(held)
    slots.erase(held)
    assert not occupied(held)
    for at, theirs in ((0, True), (SEAL_BYTES, True), (2 * SLOT_BYTES - 1, True), (2 * SLOT_BYTES, False)):
        content = bytearray(b"\xff" * 1024)
        content[at] = 42
        assert occupied(host.Eeprom(bytes(content))) == theirs
