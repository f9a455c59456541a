"""Requests of IMU streams, and rates that another station or a slow link lowers."""

import pytest

from mpucal.clocks import US, S
from mpucal.errors import LinkError
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.imu import MESSAGE_ID, Stream
from mpucal.mavlink.stream import Streams
from mpucal.simulated.vehicle import SimulatedVehicle
from mpucal.simulated.vehicle.transport import SimulatedTransport


@pytest.fixture
def streams(simulated):
    """streams(words, rate_hz) returns a simulated vehicle, its link, its Streams, and what they say."""

    def make(words, rate_hz=200.0):
        to = simulated(f"imus=1,hand=still,{words}")
        to.said = []
        to.streams = Streams(to.link, to.link.vehicle.family, {}, rate_hz, to.said.append)
        return to

    return make


@pytest.fixture
def deaf(monkeypatch):
    """deaf(kind) has simulated vehicles ignore messages of that kind."""
    return lambda kind: monkeypatch.delattr(SimulatedVehicle, f"_on_{kind.lower()}")


def watched_hz(to, seconds, lowered=None):
    """Watch the streams for that long, after another station set (name, Hz); return the rate of IMU 1's messages."""
    if lowered is not None:
        name, hz = lowered
        mav = dialect().MAVLink(None, 255, 190)
        request = mav.command_long_encode(1, 1, 511, 0, MESSAGE_ID[name], round(1e6 / hz), *[0] * 5)
        to.vehicle.receive(bytes(request.pack(mav)))
    heard = []
    for _ in range(20 * seconds):
        heard += [message.get_type() for message in to.link.messages(to.link.now_ns() + S // 20)]
        to.streams.watch()
    return max(heard.count(name) for name in MESSAGE_ID) / seconds


def test_a_vehicle_that_acknowledges_nothing_is_asked_by_groups_and_over_a_slow_link(streams, deaf):
    deaf("COMMAND_LONG")
    assert streams("highres=no", 2.0).streams.start() == Stream("RAW_IMU", 1)


def test_a_denied_rate_is_followed_by_a_lower_one_which_is_announced_once(streams):
    to = streams("highres=yes", 400.0)
    to.streams.start()
    assert watched_hz(to, 10) == pytest.approx(200, rel=0.02)
    assert to.said == ["400 Hz were asked for; the vehicle sends HIGHRES_IMU at 200 Hz."]


@pytest.mark.parametrize(
    ("words", "name", "lowered_hz", "remedy"),
    [("highres=no", "RAW_IMU", 60, "--streamrate=-1"), ("firmware=px4", "SCALED_IMU", 40, "MAV_0_RATE")],
)
def test_a_lowered_rate_is_requested_again_and_reported(streams, words, name, lowered_hz, remedy):
    to = streams(words, 100.0 if "px4" in words else 200.0)
    to.streams.start()
    before_hz = watched_hz(to, 10)
    assert watched_hz(to, 20, (name, lowered_hz)) > 0.7 * before_hz
    (told,) = to.said
    assert f"{name} was slowed down from " in told
    assert [word for word in ("--streamrate=-1", "MAV_0_RATE") if word in told] == [remedy]


def test_a_slightly_lower_rate_is_accepted(streams):
    to = streams("highres=no")
    to.streams.start()
    watched_hz(to, 10)
    assert watched_hz(to, 20, ("RAW_IMU", 160)) < 170
    assert to.said == []


def test_a_slow_clock_of_a_vehicle_is_not_reported_as_a_lowered_rate(streams, monkeypatch):
    to = streams("highres=no")
    to.streams.start()
    watched_hz(to, 10)
    slow_us = to.vehicle.now_us
    usual_ns = SimulatedTransport.now_ns

    def slow_ns(self):
        return usual_ns(self) + 3 * US * (to.vehicle.now_us - slow_us)

    monkeypatch.setattr(SimulatedTransport, "now_ns", slow_ns)
    assert watched_hz(to, 20) < 60
    assert to.said == []


@pytest.mark.parametrize(
    ("firmware", "names"), [("ardupilot", "HIGHRES_IMU and RAW_IMU were"), ("px4", "SCALED_IMU was")]
)
def test_a_vehicle_that_streams_nothing_is_one_sentence(streams, deaf, firmware, names):
    deaf("COMMAND_LONG")
    deaf("REQUEST_DATA_STREAM")
    to = streams(f"firmware={firmware}")
    with pytest.raises(LinkError, match=f"sends no IMU messages, though {names} asked for: check"):
        to.streams.start()


def test_the_messages_asked_for_are_those_of_the_dialect():
    ids = {name: getattr(dialect(), f"MAVLINK_MSG_ID_{name}") for name in MESSAGE_ID}
    assert ids == MESSAGE_ID
