"""Frames of a buffer, against the kernel's rule written down by struct, and streams brought to common times."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.errors import ChipError
from mpucal.iio.attributes import FrameLayout, ScanElement
from mpucal.iio.sample_run import StreamAligner


def element(name, index, text):
    return ScanElement.parse(name, str(index), text)


def test_a_frame_of_an_mpu_has_padding_before_its_time():
    """inv_mpu6050 of Linux 6.1: six words, two bytes of temperature, then the time at a multiple of eight."""
    names = [*(f"in_accel_{axis}" for axis in "xyz"), "in_temp", *(f"in_anglvel_{axis}" for axis in "xyz")]
    words = [element(name, i, "be:s16/16>>0") for i, name in enumerate(names)]
    layout = FrameLayout([element("in_timestamp", 9, "le:s64/64>>0\n"), *words])
    data = struct.pack(">7h2x", 1, -2, 3, -32768, 5, 32767, -7) + struct.pack("<q", 1_700_000_000_123_456_789)
    columns = layout.columns(data * 3)
    assert layout.frame_bytes == 24
    assert [int(columns[name][2]) for name in names] == [1, -2, 3, -32768, 5, 32767, -7]
    assert columns["in_timestamp"].tolist() == [1_700_000_000_123_456_789] * 3
    assert layout.packed(columns) == data * 3


@pytest.mark.parametrize(
    ("text", "stored", "value"),
    [
        ("le:s12/16>>4", struct.pack("<H", 0x8007), -2048),
        ("be:u10/16>>6", struct.pack(">H", 0xFFC0), 1023),
        ("le:s20/32>>4", struct.pack("<I", 0xFFFFFFF0), -1),
        ("le:s24/32>>8", struct.pack("<I", 0x12345678), 0x123456),
        ("le:s16/16X3>>0", struct.pack("<3h", -5, 6, 7), -5),
        ("le:s8/8>>0", b"\x80", -128),
    ],
)
def test_each_way_to_store_a_count(text, stored, value):
    layout = FrameLayout([element("in_accel_x", 0, text)])
    assert layout.columns(stored)["in_accel_x"].tolist() == [value]


def test_invalid_types_and_frames_are_reported():
    for text in ("s16/16>>0", "le:s0/16>>0", "le:s16/16>>4", "le:s16/16X0>>0"):
        with pytest.raises(ChipError, match="storage of in_accel_x as"):
            element("in_accel_x", 0, text)
    with pytest.raises(ChipError, match="5 bytes, but a frame has 2"):
        FrameLayout([element("in_accel_x", 0, "le:s16/16>>0")]).columns(bytes(5))


STEPS = st.lists(st.integers(1, 9), min_size=2, max_size=30)
CALLS = st.lists(st.tuples(st.integers(0, 1), st.integers(0, 5)), max_size=30)


@given(STEPS, STEPS, CALLS)
def test_alignment_is_numpys_interpolation_for_any_division_of_the_samples(one, other, calls):
    t, s = np.cumsum(one), np.cumsum(other)
    values, held = np.sin(t)[:, None], np.cos(s)[:, None] * [1.0, 2.0]
    aligned, rows = StreamAligner([1, 2]), []
    at = [0, 0]
    for stream, count in [*calls, (0, len(t)), (1, len(s))]:
        times, columns = ((t, values), (s, held))[stream]
        first, at[stream] = at[stream], min(at[stream] + count, len(times))
        aligned.add(stream, times[first : at[stream]], columns[first : at[stream]])
        times_ns, found = aligned.take()
        rows += [(int(when), *row) for when, row in zip(times_ns, found, strict=True)]
    inside = (t >= s[0]) & (t <= s[-1])
    expected = np.column_stack((t[inside], values[inside], *(np.interp(t[inside], s, column) for column in held.T)))
    np.testing.assert_allclose(np.array(rows).reshape(-1, 4), expected, rtol=1e-12, atol=1e-12)
