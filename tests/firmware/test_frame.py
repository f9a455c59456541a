"""The core's frames against the Python codec's, golden vectors, and chance."""

import ctypes
import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.bridge.frame import MAX_CONTENT, MAX_ENCODED, MAX_PAYLOAD, Deframer, Frame, stuff

VECTORS = sorted((Path(__file__).parents[2] / "fixtures" / "vectors").glob("line_*.bin"))
# fewer with sanitizers, which are slow
RANDOM_FRAMES = 200_000 if "MPUCAL_SANITIZE" in os.environ else 1_000_000


class Incoming(ctypes.Structure):
    """struct mpucal_incoming."""

    _fields_ = (("bytes", ctypes.c_uint8 * MAX_ENCODED), ("size", ctypes.c_uint8))


@pytest.fixture(scope="module")
def found(core):
    def find(data: bytes) -> list[Frame]:
        incoming, frames = Incoming(), []
        for byte in data:
            size = core.mpucal_frame_receive(ctypes.byref(incoming), byte)
            if size:
                content = bytes(incoming.bytes[1 : 1 + size])
                frames.append(Frame(content[0], content[1], content[2:]))
        return frames

    return find


@pytest.fixture(scope="module")
def closed(core):
    def close(frame: Frame) -> bytes:
        content = bytes([0, frame.type, frame.seq]) + frame.payload
        buffer = ctypes.create_string_buffer(content, MAX_ENCODED + 1)
        size = core.mpucal_frame_close(buffer, len(content) - 1)
        return buffer.raw[:size]

    return close


frames = st.builds(Frame, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=MAX_PAYLOAD))


def test_finds_the_frames_of_every_golden_vector(found):
    for path in VECTORS:
        wanted = json.loads(path.with_suffix(".json").read_text())["frames"]
        assert found(path.read_bytes()) == [
            Frame(frame["type"], frame["seq"], bytes.fromhex(frame["payload"])) for frame in wanted
        ], path


@given(frame=frames)
def test_encodes_as_python_does_and_decodes_what_it_encoded(frame, found, closed):
    assert closed(frame) == frame.encode()
    assert found(closed(frame)) == [frame]


# bytes from a line: whole frames, damaged ones, and noise
pieces = st.one_of(
    frames.map(Frame.encode),
    st.binary(max_size=2 * MAX_ENCODED),
    st.binary(max_size=MAX_CONTENT).map(lambda content: stuff(content) + b"\0"),
    st.tuples(frames.map(Frame.encode), st.integers(0, MAX_ENCODED), st.integers(1, 255)).map(
        lambda it: bytes(byte ^ (it[2] if i == it[1] else 0) for i, byte in enumerate(it[0]))
    ),
    st.tuples(frames.map(Frame.encode), st.integers(0, MAX_ENCODED)).map(lambda it: it[0][: it[1]]),
)


@given(data=st.lists(pieces, max_size=6).map(b"".join))
def test_finds_the_same_frames_as_python_in_any_bytes(data, found):
    assert found(data) == list(Deframer().feed(data))


def test_a_piece_of_any_length_leaves_it_ready_for_the_next_frame(found):
    frame = Frame(2, 7, b"\x75\x01")
    for size in range(MAX_ENCODED - 1, 4 * MAX_ENCODED):
        assert found(b"\x01" * size + b"\0" + frame.encode())[-1:] == [frame], size


def test_accepts_no_more_random_frames_than_16_bits_let_through(core):
    by_chance = RANDOM_FRAMES / 2**16
    accepted = core.host_accepted(1, RANDOM_FRAMES)
    # five standard deviations of chance
    assert abs(accepted - by_chance) < 5 * by_chance**0.5
