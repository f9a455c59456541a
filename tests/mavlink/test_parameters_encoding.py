"""Parameters on the wire, through pymavlink's own packing and back; their files; their slots and mounting."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.errors import RecordingError
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.parameters.encoding import error_name, from_wire, name_bytes, to_wire
from mpucal.mavlink.parameters.mounting import mounting
from mpucal.mavlink.parameters.slots import all_slots, find_slot
from mpucal.mavlink.parameters.text import param_text, params_text, read_parameters_file

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
RANGES = {INT8: 8, INT16: 16, INT32: 32}


def sent(name, value, kind, bytewise):
    mav = dialect().MAVLink(None, 1, 1)
    message = mav.param_value_encode(name_bytes(name), to_wire(value, kind, bytewise), kind, 100, 7)
    (packet,) = Parser(dialect().MAVLink(None)).datagram(bytes(message.pack(mav)))
    return from_wire(packet.message, bytewise)


@given(st.sampled_from(sorted(RANGES)), st.data())
def test_integers_travel_by_their_bytes_to_px4(kind, data):
    most = 1 << (RANGES[kind] - 1)
    value = data.draw(st.integers(-most, most - 1))
    # the bytes of a signalling NaN do not survive as a float
    bits = value & 0xFFFFFFFF
    if (bits & 0x7F800000) == 0x7F800000 and bits & 0x007FFFFF and not bits & 0x00400000:
        return
    parameter = sent("CAL_ACC0_ID", value, kind, True)
    assert (parameter.value, parameter.index, parameter.count) == (value, 7, 100)


@given(st.integers(-(1 << 24), 1 << 24), st.floats(width=32, allow_nan=False, allow_infinity=False), st.booleans())
def test_other_values_travel_as_they_are(whole, value, bytewise):
    assert sent("INS_ACC_ID", whole, INT32, False).value == whole
    assert sent("X", value, REAL32, bytewise).value == value


def test_a_name_of_sixteen_letters_has_no_end_mark():
    assert sent("ABCDEFGHIJKLMNOP", 1.0, REAL32, False).name == "ABCDEFGHIJKLMNOP"


def test_errors_beyond_pymavlinks_enumeration_have_words():
    assert error_name(7) == "it has another type"
    assert error_name(99) == "error 99"


@settings(max_examples=30)
@given(st.dictionaries(st.text("ABCXYZ019_", min_size=2, max_size=16), st.floats(width=32, allow_nan=False)))
def test_both_files_give_back_each_float32(tmp_path_factory, values):
    folder = tmp_path_factory.mktemp("parameters")
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    texts = {"a.param": param_text(finite, ["a remark"]), "a.params": params_text(finite, ["a remark"], system=3)}
    for name, text in texts.items():
        (folder / name).write_text(text)
        assert read_parameters_file(folder / name) == finite
    rows = [row.split("\t") for row in texts["a.params"].splitlines() if not row.startswith("#")]
    assert [(row[:3], row[4]) for row in rows] == [(["3", "1", name], "9") for name in finite]


@pytest.mark.parametrize("text", ["NAME,VALUE,MORE\n", "NAME,word\n", "\xff"], ids=["columns", "word", "letters"])
def test_another_file_is_refused(tmp_path, text):
    (tmp_path / "x.param").write_text(text, encoding="latin-1")
    with pytest.raises(RecordingError):
        read_parameters_file(tmp_path / "x.param")


def test_slots_are_named_by_px4s_ids_and_ardupilots_numbers():
    ids = {"CAL_ACC0_ID": 0.0, "CAL_ACC1_ID": 1310988.0, "CAL_ACC2_ID": 1310996.0}
    assert find_slot("PX4", 1, ids).offset[0] == "CAL_ACC1_XOFF"
    assert find_slot("PX4", 2, ids).scale[2] == "CAL_ACC2_ZSCALE"
    assert find_slot("PX4", 3, ids) is None
    names = [find_slot("ArduPilot", imu, {}).offset[0] for imu in (1, 2, 3)]
    assert names == ["INS_ACCOFFS_X", "INS_ACC2OFFS_X", "INS_ACC3OFFS_X"]
    assert names == [slot.offset[0] for slot in all_slots("ArduPilot")]


def test_the_mounting_is_that_of_the_board_unless_the_sensor_is_outside():
    slot = find_slot("PX4", 1, {"CAL_ACC0_ID": 5.0})
    board = {"SENS_BOARD_ROT": 2.0, "CAL_ACC0_ROT": -1.0}
    outside = board | {"CAL_ACC0_ROT": 4.0}
    level = board | {"SENS_BOARD_ROT": 0.0, "SENS_BOARD_Z_OFF": 90.0}
    for values, x in ((board, [0, 1, 0]), (outside, [-1, 0, 0]), (level, [0, 1, 0])):
        np.testing.assert_allclose(mounting("PX4", slot, values) @ [1, 0, 0], x, atol=1e-12)


def test_a_custom_orientation_needs_its_angles():
    slot = find_slot("ArduPilot", 1, {})
    assert mounting("ArduPilot", slot, {"AHRS_ORIENTATION": 101.0}) is None
    assert mounting("ArduPilot", slot, {}) is None
    angles = {"CUST_ROT1_ROLL": 0.0, "CUST_ROT1_PITCH": 0.0, "CUST_ROT1_YAW": 90.0}
    turned = mounting("ArduPilot", slot, {"AHRS_ORIENTATION": 101.0, **angles})
    np.testing.assert_allclose(turned @ [1, 0, 0], [0, 1, 0], atol=1e-12)
