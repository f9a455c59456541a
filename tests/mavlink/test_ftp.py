"""Files on a vehicle's storage: the protocol's bytes, and transfers over a bad line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.errors import LinkError
from mpucal.mavlink.ftp import MOST_DATA, Payload, Storage
from mpucal.mavlink.link import Link
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport


@pytest.fixture
def stored():
    """stored(words): a vehicle, and its storage over a link."""

    def make(words):
        vehicle = SimulatedVehicle(VehicleOptions.parse(words))
        link = Link(SimulatedTransport(vehicle), lambda t_ns, packet: None)
        link.lock(link.listen()[0])
        return vehicle, Storage(link)

    return make


@given(
    st.integers(0, 65535),
    st.integers(0, 255),
    st.integers(0, 255),
    st.binary(max_size=MOST_DATA),
    st.integers(0, 2**32 - 1),
)
def test_a_payload_comes_back_as_it_went(sequence, session, opcode, data, offset):
    payload = Payload(sequence, session, opcode, data, offset, None, 7)
    encoded = payload.encode()
    assert len(encoded) == 251
    decoded = Payload.decode(encoded)
    assert (decoded.sequence, decoded.session, decoded.opcode, decoded.data, decoded.offset, decoded.requested) == (
        sequence,
        session,
        opcode,
        data,
        offset,
        7,
    )


def test_a_payload_has_pymavlinks_layout():
    mavftp = pytest.importorskip("pymavlink.mavftp")
    theirs = mavftp.FTP_OP(513, 3, mavftp.OP_WriteFile, 4, 0, 0, 1000, bytearray(b"data")).pack()
    assert Payload(513, 3, 7, b"data", 1000).encode().startswith(bytes(theirs))


@pytest.mark.parametrize("words", ["sim", "sim:fault=loss", "sim:fault=reorder,fault=duplicate"], ids=str)
@pytest.mark.parametrize("size", [0, 1, MOST_DATA, 1000])
def test_a_file_arrives_whole(stored, words, size):
    vehicle, storage = stored(words)
    data = bytes(n % 251 for n in range(size))
    storage.put("/APM/x.bin", data)
    assert vehicle.card.files["/APM/x.bin"] == data
    assert storage.get("/APM/x.bin") == data
    storage.remove("/APM/x.bin")
    assert vehicle.card.files == {}


@pytest.mark.parametrize("words", ["sim:fault=no_storage", "sim:fault=silence@2.001"], ids=["no card", "gone"])
def test_a_vehicle_that_keeps_nothing_says_why(stored, words):
    _, storage = stored(words)
    with pytest.raises(LinkError, match="does not keep"):
        storage.put("/APM/x.bin", b"data")


def test_what_comes_back_otherwise_is_noticed(stored):
    vehicle, storage = stored("sim")
    vehicle.card.files = type("Forgetful", (dict,), {"__getitem__": lambda self, path: b"other"})()
    with pytest.raises(LinkError, match="another"):
        storage.put("/APM/x.bin", b"data!")
