"""Files in a vehicle's storage: the protocol's bytes, and transfers over a bad line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.errors import LinkError
from mpucal.mavlink.ftp import MOST_DATA, Payload, Storage

BYTE = st.integers(0, 255)


@given(st.integers(0, 65535), BYTE, BYTE, st.binary(max_size=MOST_DATA), st.integers(0, 2**32 - 1), BYTE)
def test_a_payload_is_decoded_as_it_was_encoded(sequence, session, opcode, data, offset, requested):
    payload = Payload(sequence, session, opcode, data, offset, len(data), requested)
    encoded = payload.encode()
    assert len(encoded) == 251
    assert Payload.decode(encoded) == payload


def test_a_payload_has_pymavlinks_layout():
    mavftp = pytest.importorskip("pymavlink.mavftp")
    theirs = mavftp.FTP_OP(513, 3, mavftp.OP_WriteFile, 4, 0, 0, 1000, bytearray(b"data")).pack()
    assert Payload(513, 3, 7, b"data", 1000).encode().startswith(bytes(theirs))


@pytest.mark.parametrize(("words", "size"), [("", 0), ("fault=loss", MOST_DATA), ("fault=reorder", 1000)])
def test_a_file_arrives_whole(simulated, words, size):
    to = simulated(words)
    storage, files, data = Storage(to.link), to.vehicle.card.files, bytes(n % 251 for n in range(size))
    storage.put("/APM/x.bin", data)
    assert files == {"/APM/x.bin": data}
    assert storage.get("/APM/x.bin") == data
    storage.remove("/APM/x.bin")
    assert files == {}


@pytest.mark.parametrize("words", ["fault=no_storage", "fault=silence@2.001"], ids=["no card", "gone"])
def test_a_vehicle_that_keeps_nothing_says_why(simulated, words):
    with pytest.raises(LinkError, match="does not keep"):
        Storage(simulated(words).link).put("/APM/x.bin", b"data")


def test_a_file_that_is_read_back_otherwise_is_noticed(simulated):
    to = simulated()
    to.vehicle.card.files = type("Forgetful", (dict,), {"__getitem__": lambda self, path: b"other"})()
    with pytest.raises(LinkError, match="another"):
        Storage(to.link).put("/APM/x.bin", b"data!")
