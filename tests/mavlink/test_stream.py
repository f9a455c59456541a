"""Requests of IMU streams, and rates that another station or a slow link lowers."""

import pytest

from mpucal.errors import LinkError
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.firmwares import ARDUPILOT, PX4
from mpucal.mavlink.imu import MESSAGE_ID, Stream
from mpucal.mavlink.link import Link, S
from mpucal.mavlink.stream import Streams

HOME = "10.0.0.2:14555"
RAW, HIGHRES, SCALED, SCALED2 = 27, 105, 26, 116


@pytest.fixture
def vehicle(script, station, decoded):
    """vehicle(...) returns a transport to one that streams the requested messages, as ArduPilot does."""

    class Streaming(script):
        outward = False

        def __init__(self, streams=(RAW,), fastest_hz=333, commands=True, groups=False):
            super().__init__([(0.5 + k, HOME, maker.heartbeat()) for k in range(60)])
            self.streams, self.fastest_hz, self.commands, self.groups = streams, fastest_hz, commands, groups
            self.interval_ns = {}
            self.due_ns = {}
            self.asked = []
            self.answer = self.answered
            self.slower = 1

        def set(self, message_id, hz):
            self.interval_ns[message_id] = round(S / hz)
            self.due_ns[message_id] = self.now_ns()

        def answered(self, data):
            message = decoded(data)
            if message.get_type() == "REQUEST_DATA_STREAM" and self.groups:
                self.set(RAW, message.req_message_rate)
            if message.get_type() != "COMMAND_LONG" or not self.commands:
                return []
            message_id, hz = int(message.param1), 1e6 / message.param2
            self.asked.append((message_id, round(hz)))
            result = 3 if message_id not in self.streams else 2 if hz > self.fastest_hz else 0
            if not result:
                self.set(message_id, hz)
            return [maker.message("command_ack", message.command, result)]

        def receive(self, until_ns):
            due = [(t_ns, message_id) for message_id, t_ns in self.due_ns.items()]
            t_ns, message_id = min(due, default=(until_ns, 0))
            if t_ns < until_ns and not (self.arriving and self.arriving[0].t_ns <= t_ns):
                data = MAKE[message_id](t_ns // 1000 // self.slower)
                self.due_ns[message_id] += self.interval_ns[message_id]
                self.arriving = [*script([(t_ns / S, HOME, data)]).arriving, *self.arriving]
            return super().receive(until_ns)

    maker = station()
    MAKE = {
        RAW: maker.raw,
        SCALED: lambda t_us: maker.message("scaled_imu", t_us // 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0),
        SCALED2: lambda t_us: maker.message("scaled_imu2", t_us // 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0),
        HIGHRES: lambda t_us: maker.message(
            "highres_imu", t_us, 0, 0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 25.0, 0xFFFF, 0
        ),
    }
    return Streaming


def polling(link, asked, seconds):
    """Watch the streams for that long, as a session's source does."""
    for _ in range(20 * seconds):
        list(link.messages(link.now_ns() + S // 20))
        asked.watch()


def streams(transport, said=None, rate_hz=200.0, firmware=ARDUPILOT):
    link = Link(transport, lambda t_ns, data: None)
    link.lock(link.listen()[0])
    return link, Streams(link, firmware, {}, rate_hz, (said if said is not None else []).append)


@pytest.mark.parametrize(
    ("what", "first"),
    [
        ({"streams": (HIGHRES, RAW)}, "HIGHRES_IMU"),
        ({"streams": (RAW, SCALED2)}, "RAW_IMU"),
        ({"streams": (), "groups": True}, "RAW_IMU"),
        ({"commands": False, "groups": True}, "RAW_IMU"),
    ],
    ids=["highres", "raw", "REQUEST_DATA_STREAM", "an autopilot that acknowledges nothing"],
)
def test_the_truest_stream_there_is(vehicle, what, first):
    _, asked = streams(vehicle(**what))
    assert asked.start() == Stream(first, 1)


def test_a_denied_rate_is_followed_by_lower_ones(vehicle):
    transport = vehicle(fastest_hz=120)
    _, asked = streams(transport, rate_hz=400.0)
    asked.start()
    assert [hz for message_id, hz in transport.asked if message_id == RAW] == [400, 200, 100]


def test_a_lower_rate_than_requested_is_reported_once(vehicle):
    said = []
    link, asked = streams(vehicle(fastest_hz=120), said, rate_hz=400.0)
    asked.start()
    polling(link, asked, 10)
    assert said == ["400 Hz were asked for; the vehicle sends RAW_IMU at 100 Hz."]


def watched(transport, lowered_hz, said, firmware=ARDUPILOT):
    """Return the rate of IMU 1's messages in the 20 s after another station set it."""
    message_id, name = (SCALED, "SCALED_IMU") if firmware == PX4 else (RAW, "RAW_IMU")
    link, asked = streams(transport, said, firmware=firmware)
    asked.start()
    counted = []
    link.subscribe(lambda message: counted.append(message) if message.get_type() == name else None)
    polling(link, asked, 10)
    counted.clear()
    transport.set(message_id, lowered_hz)
    polling(link, asked, 20)
    return len(counted) / 20.0


@pytest.mark.parametrize(
    ("firmware", "lowered_hz", "name", "remedy"),
    [
        (ARDUPILOT, 4, "RAW_IMU", "--streamrate=-1"),
        (ARDUPILOT, 60, "RAW_IMU", "--streamrate=-1"),
        (PX4, 60, "SCALED_IMU", "MAV_0_RATE"),
    ],
)
def test_a_lowered_rate_is_requested_again_and_reported(vehicle, firmware, lowered_hz, name, remedy):
    said = []
    assert watched(vehicle(streams=(SCALED if firmware == PX4 else RAW,)), lowered_hz, said, firmware) > 140
    (told,) = said
    assert f"{name} was slowed down from 200 Hz" in told
    assert [word for word in ("--streamrate=-1", "MAV_0_RATE") if word in told] == [remedy]


def test_a_slightly_lower_rate_is_accepted(vehicle):
    said = []
    assert watched(vehicle(), 160, said) < 170
    assert said == []


def test_a_vehicle_whose_time_goes_slowly_was_slowed_by_nobody(vehicle):
    said, transport = [], vehicle()
    transport.slower = 4
    assert watched(transport, 50, said) < 60
    assert said == []
    assert transport.asked.count((RAW, 200)) == 1


def test_a_vehicle_that_streams_nothing_is_one_sentence(vehicle):
    for firmware, names in ((ARDUPILOT, "HIGHRES_IMU and RAW_IMU were"), (PX4, "SCALED_IMU was")):
        _, asked = streams(vehicle(streams=()), firmware=firmware)
        with pytest.raises(LinkError, match=f"sends no IMU messages, though {names} asked for: check"):
            asked.start()


def test_a_slow_link_brings_the_first_ones_late(vehicle):
    _, asked = streams(vehicle(streams=(RAW,), fastest_hz=333), rate_hz=1.2)
    assert asked.start() == Stream("RAW_IMU", 1)


def test_the_messages_asked_for_are_those_of_the_dialect():
    ids = {name: getattr(dialect(), f"MAVLINK_MSG_ID_{name}") for name in MESSAGE_ID}
    assert ids == MESSAGE_ID
