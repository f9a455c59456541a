"""The parser: streams that are cut anywhere, junk and damage; IMU messages in SI units."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.imu import ACC_LSB_MPS2, GYRO_LSB_RAD_S, decode_reading


@pytest.fixture(scope="module")
def packets(station):
    vehicle = station()
    return [
        vehicle.heartbeat(),
        vehicle.raw(1_000_000),
        vehicle.message("statustext", 6, b"x" * 50),
        vehicle.message("param_value", b"INS_ACCOFFS_X", 0.5, 9, 10, 3),
        dialect().MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3).pack(vehicle.mav, force_mavlink1=True),
    ]


def parser():
    return Parser(dialect().MAVLink(None))


def data_of(found):
    return [packet.data for packet in found]


@given(order=st.lists(st.integers(0, 4), max_size=8), cuts=st.lists(st.integers(0, 400), max_size=6))
def test_a_stream_gives_its_packets_in_any_pieces(packets, order, cuts):
    chosen = [bytes(packets[k]) for k in order]
    whole = b"".join(chosen)
    edges = [0, *sorted(min(cut, len(whole)) for cut in cuts), len(whole)]
    parse = parser()
    found = [packet for a, b in pairwise(edges) for packet in parse.stream(whole[a:b])]
    assert data_of(found) == chosen


@given(junk=st.binary(max_size=60))
def test_a_packet_after_junk_is_found(packets, junk):
    # enough bytes to complete any packet that the junk seems to begin
    stream = junk + b"".join(packets) * 8
    found = data_of(parser().stream(stream))
    assert found[-1] == bytes(packets[-1])
    assert len(found) >= 20


@given(data=st.data())
def test_a_damaged_packet_is_left_out(packets, data):
    packet = bytearray(packets[data.draw(st.integers(0, 3))])
    at = data.draw(st.integers(0, len(packet) - 1))
    packet[at] ^= data.draw(st.integers(1, 255))
    found = parser().datagram(bytes(packet) + bytes(packets[1]))
    assert bytes(packet) not in data_of(found) or found[0].message.get_type().startswith("UNKNOWN")


@given(mg=st.floats(-16000, 16000), mrad_s=st.floats(-32000, 32000))
def test_a_truncated_value_is_centred(station, decoded, mg, mrad_s):
    content = decode_reading(decoded(station().raw(1, (int(mg), 0, -1000), (0, int(mrad_s), 0))))
    assert content.acc[0] == pytest.approx(mg * ACC_LSB_MPS2, abs=(0.5 if int(mg) else 1.0) * ACC_LSB_MPS2 + 1e-9)
    assert content.gyr[1] == pytest.approx(
        mrad_s * GYRO_LSB_RAD_S, abs=(0.5 if int(mrad_s) else 1.0) * GYRO_LSB_RAD_S + 1e-9
    )
    assert content.acc[2] == pytest.approx(-9.80665 - 0.5 * ACC_LSB_MPS2)


def highres(station, decoded, acc=(0.1, 0.2, -9.8), updated=0xFFFF, id_=1):
    fields = (77, *acc, 0.01, 0.02, 0.03, 0, 0, 0, 0, 0, 0, 25.5, updated, id_)
    return decode_reading(decoded(station().message("highres_imu", *fields)))


def test_a_message_without_new_values_is_none(station, decoded):
    for how in ({"updated": 0x38}, {"updated": 0x07}, {"acc": (math.nan, 0, 0)}):
        assert highres(station, decoded, **how) is None
    assert decode_reading(decoded(station().heartbeat())) is None
