import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.bridge.frame import (
    CHECKSUM,
    HEADER,
    MAX_ENCODED,
    MAX_PAYLOAD,
    Deframer,
    Frame,
    FrameError,
    crc16,
    stuff,
)

VECTORS = Path(__file__).parents[2] / "fixtures" / "vectors"
NAMES = sorted(path.stem for path in VECTORS.glob("line_*.bin"))

frames = st.builds(Frame, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=MAX_PAYLOAD))


def found(*pieces):
    deframer = Deframer()
    return [frame for piece in pieces for frame in deframer.feed(piece)]


@pytest.mark.parametrize(
    ("content", "encoded"),
    [
        (b"", "01"),
        (b"\0", "01 01"),
        (b"\0\0", "01 01 01"),
        (b"\x11\x22\0\x33", "03 11 22 02 33"),
        (b"\x11\x22\x33\x44", "05 11 22 33 44"),
        (b"\x11\0\0\0", "02 11 01 01 01"),
    ],
    ids=["nothing", "a zero", "two", "one within", "none", "at the end"],
)
def test_cobs_as_its_inventors_print_it(content, encoded):
    assert stuff(content) == bytes.fromhex(encoded)


@given(frames, st.data())
def test_up_to_three_flipped_bits_are_noticed(frame, data):
    """CRC-16/CCITT has Hamming distance 4 up to 32751 bits; a flip in COBS itself moves bytes, or makes a zero."""
    content = HEADER.pack(frame.type, frame.seq) + frame.payload
    content += CHECKSUM.pack(crc16(content))
    flips = data.draw(st.sets(st.integers(0, 8 * len(content) - 1), min_size=1, max_size=3))
    number = int.from_bytes(content, "little")
    for flip in flips:
        number ^= 1 << flip
    assert found(stuff(number.to_bytes(len(content), "little")) + b"\0") == []


def test_a_payload_that_is_too_long_is_refused():
    with pytest.raises(FrameError, match="67 bytes is longer than 66"):
        Frame(1, 2, bytes(67)).encode()


def test_a_line_without_zeros_takes_no_memory():
    deframer = Deframer()
    for _ in range(1000):
        assert list(deframer.feed(b"\x55" * 1000)) == []
    assert len(vars(deframer)["_piece"]) <= MAX_ENCODED + 1


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_golden_vectors(size):
    for name in NAMES:
        data = (VECTORS / f"{name}.bin").read_bytes()
        expected = json.loads((VECTORS / f"{name}.json").read_text())["frames"]
        got = found(*(data[i : i + size] for i in range(0, len(data), size)))
        assert got == [Frame(f["type"], f["seq"], bytes.fromhex(f["payload"])) for f in expected], name
