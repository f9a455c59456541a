"""Fixtures: a link over simulated time, packets of a vehicle, and a link to the simulated vehicle."""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import Link
from mpucal.mavlink.tlog import RawPacket
from mpucal.mavlink.transports import ReceivedBytes
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport

S = 1_000_000_000


@pytest.fixture
def captures(shared) -> Path:
    return shared("captures")[0]


class Script:
    """Transport that plays (time [s], address, data), and keeps the packets that are sent."""

    datagrams = True
    name = "a script"

    def __init__(self, arriving: Sequence[tuple[float, str, bytes]], outward: bool = False, datagrams: bool = True):
        self.arriving = [ReceivedBytes(data, address, round(t * S)) for t, address, data in arriving]
        self.outward, self.datagrams = outward, datagrams
        self.sent: list[tuple[float, str | None, bytes]] = []
        self.answer: Callable[[bytes], Sequence[bytes]] = lambda data: ()
        self._now_ns = 0

    def now_ns(self) -> int:
        return self._now_ns

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        if self.arriving and self.arriving[0].t_ns < until_ns:
            received = self.arriving.pop(0)
            self._now_ns = max(self._now_ns, received.t_ns)
            return received
        self._now_ns = max(self._now_ns, until_ns)
        return None

    def restrict(self, address: str | None) -> None:
        pass

    def send(self, data: bytes, address: str | None) -> None:
        self.sent.append((self._now_ns / S, address, data))
        answers = [ReceivedBytes(answer, address or "vehicle:1", self._now_ns) for answer in self.answer(data)]
        self.arriving = [*answers, *self.arriving]

    def close(self) -> None:
        pass


@pytest.fixture
def script() -> type[Script]:
    return Script


@pytest.fixture(scope="session")
def station():
    """station(system) makes packets: heartbeat(), raw(t_us), message(name, *fields)."""

    def make(system: int = 1, component: int = 1, autopilot: int = 3, key: bytes | None = None):
        m = dialect()
        mav = m.MAVLink(None, system, component)
        if key is not None:
            mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.timestamp = key, True, 1 << 40

        def packed(message):
            data = bytes(message.pack(mav))
            mav.seq = (mav.seq + 1) % 256
            return data

        def message(name, *fields):
            return packed(getattr(mav, f"{name}_encode")(*fields))

        def heartbeat():
            return message("heartbeat", m.MAV_TYPE_QUADROTOR, autopilot, 81, 0, 3)

        def raw(t_us, acc=(1, -2, -998), gyr=(3, 0, -4)):
            return message("raw_imu", t_us, *acc, *gyr, 0, 0, 0, 0, 2500)

        return SimpleNamespace(message=message, heartbeat=heartbeat, raw=raw, mav=mav)

    return make


@pytest.fixture(scope="session")
def decoded():
    """decoded(data) returns the message in a packet."""
    mav = dialect().MAVLink(None)
    return lambda data: mav.decode(bytearray(data))


@pytest.fixture
def simulated():
    """simulated(words) returns a simulated vehicle, a link to it, and the packets that the link records."""

    def make(words: str = "", lock: bool = True, **options):
        vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}" if words else "sim"))
        record: list[RawPacket] = []
        link = Link(SimulatedTransport(vehicle), lambda t_ns, data: record.append(RawPacket(t_ns, data)), **options)
        if lock:
            link.lock(link.listen()[0])
        return SimpleNamespace(vehicle=vehicle, link=link, record=record)

    return make
