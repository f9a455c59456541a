"""Packed integers, there and back; what is cut or too long is a ValueError."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mpucal.files import protobuf


@given(st.lists(st.integers(-(2**63), 2**63 - 1)))
def test_numbers_come_back(numbers):
    given_ = np.array(numbers, np.int64)
    np.testing.assert_array_equal(
        protobuf.unzigzag(protobuf.unpacked(protobuf.pack_varints(protobuf.zigzag(given_)))), given_
    )


@given(arrays(np.int16, st.tuples(st.integers(0, 5), st.integers(1, 7))))
def test_frames_come_back(frames):
    steps = np.diff(frames, axis=0, prepend=np.int16(0)).ravel()
    read = protobuf.frames(protobuf.pack_varints(protobuf.zigzag(steps)), frames.shape[1])
    np.testing.assert_array_equal(read, frames)


@pytest.mark.parametrize(
    ("data", "words", "says"),
    [(b"\x01\x80", 1, "cut"), (b"\x80" * 10 + b"\x01", 1, "longer"), (b"\x01\x01\x01", 2, "cut"), (b"", 0, "no words")],
)
def test_damage_is_named(data, words, says):
    with pytest.raises(ValueError, match=says):
        protobuf.frames(data, words)
