"""Parameters on the wire, through pymavlink's own packing and back; their files."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.errors import RecordingError
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.parameters.encoding import (
    from_wire,
    name_bytes,
    parameters_text,
    read_parameters_file,
    to_wire,
)

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
RANGES = {INT8: 8, INT16: 16, INT32: 32}


def sent(name, value, kind, bytewise):
    mav = dialect().MAVLink(None, 1, 1)
    message = mav.param_value_encode(name_bytes(name), to_wire(value, kind, bytewise), kind, 100, 7)
    (packet,) = Parser(dialect().MAVLink(None)).datagram(bytes(message.pack(mav)))
    return from_wire(packet.message, bytewise)


def test_names_of_sixteen_letters_and_other_values_travel_as_they_are():
    for value, kind, bytewise in ((1 << 24, INT32, False), (0.1, REAL32, True), (-3.5, REAL32, False)):
        parameter = sent("ABCDEFGHIJKLMNOP", value, kind, bytewise)
        assert (parameter.name, parameter.value) == ("ABCDEFGHIJKLMNOP", np.float32(value))


@given(st.sampled_from(sorted(RANGES)), st.data())
def test_integers_travel_by_their_bytes_to_px4(kind, data):
    most = 1 << (RANGES[kind] - 1)
    value = data.draw(st.integers(-most, most - 1))
    # the bytes of a signalling NaN do not survive as a float
    bits = value & 0xFFFFFFFF
    if (bits & 0x7F800000) == 0x7F800000 and bits & 0x007FFFFF and not bits & 0x00400000:
        return
    assert sent("CAL_ACC0_ID", value, kind, True).value == value


@settings(max_examples=30)
@given(st.dictionaries(st.text("ABCXYZ019_", min_size=2, max_size=16), st.floats(width=32, allow_nan=False)))
def test_both_files_give_back_each_float32(tmp_path_factory, values):
    folder = tmp_path_factory.mktemp("parameters")
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    for firmware in ("ArduPilot", "PX4"):
        (folder / firmware).write_text(parameters_text(firmware, finite, ["a remark"], system=3))
        assert read_parameters_file(folder / firmware) == finite


@pytest.mark.parametrize("text", ["NAME,VALUE,MORE\n", "NAME,word\n", "\xff"], ids=["columns", "word", "letters"])
def test_another_file_is_refused(tmp_path, text):
    (tmp_path / "x.param").write_text(text, encoding="latin-1")
    with pytest.raises(RecordingError):
        read_parameters_file(tmp_path / "x.param")
