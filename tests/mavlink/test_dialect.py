"""The parser: streams that are cut anywhere, junk, damage and signatures."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.mavlink.dialect import Parser, dialect


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
def test_a_stream_gives_its_packets_however_it_is_cut(packets, order, cuts):
    chosen = [bytes(packets[k]) for k in order]
    whole = b"".join(chosen)
    edges = [0, *sorted(min(cut, len(whole)) for cut in cuts), len(whole)]
    parse = parser()
    found = [packet for a, b in pairwise(edges) for packet in parse.stream(whole[a:b])]
    assert data_of(found) == chosen


@given(junk=st.binary(max_size=60))
def test_a_packet_after_junk_is_found(packets, junk):
    # so many bytes that whatever the junk seems to announce comes to its end
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


def test_a_cut_datagram_leaves_nothing_to_the_next(packets):
    parse = parser()
    assert parse.datagram(bytes(packets[1][:-3])) == []
    assert data_of(parse.datagram(bytes(packets[1]))) == [bytes(packets[1])]


def test_a_wrong_signature_is_refused_and_counted(station):
    signed = station(key=b"k" * 32).heartbeat()
    for key, accepted in ((b"k" * 32, 1), (b"x" * 32, 0)):
        mav = dialect().MAVLink(None)
        mav.signing.secret_key = key
        parse = Parser(mav)
        assert len(parse.datagram(signed)) == accepted
        assert parse.refused == 1 - accepted
