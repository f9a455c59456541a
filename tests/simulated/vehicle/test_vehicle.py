"""Simulated vehicle: the behaviour of ArduPilot and PX4, quirks included."""

import subprocess
from collections import Counter
from contextlib import suppress

import numpy as np
import pytest

from mpucal.errors import NoAnswer
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.imu import MESSAGE_ID
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.encoding import name_bytes, to_wire
from mpucal.mavlink.requests import send_command
from mpucal.mavlink.texts import ReceivedPrompt, encode_prompt
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import parse_url
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.px4 import DEVICE_IDS
from mpucal.sources.opening import open_source

S_US = 1_000_000
HIGHRES, RAW, SCALED, SCALED2 = 105, 27, 26, 116
ACCEPTED, DENIED, FAILED = 0, 2, 4
REAL32, INT32 = 9, 6


class Station:
    """Ground station of a simulated vehicle."""

    def __init__(self, words=""):
        self.vehicle = SimulatedVehicle(VehicleOptions.parse("sim" + (":" + words if words else "")))
        self.mav = dialect().MAVLink(None, 254, 190)
        self._parser = Parser(dialect().MAVLink(None))

    def say(self, kind, *fields):
        self.vehicle.receive(bytes(getattr(self.mav, f"{kind}_encode")(*fields).pack(self.mav)))

    def command(self, number, *params):
        self.say("command_long", 1, 1, number, 0, *params, *[0] * (7 - len(params)))
        return next(m.result for m in self.hear(0.01) if m.get_type() == "COMMAND_ACK")

    def interval(self, message_id, rate_hz):
        return self.command(511, message_id, round(1e6 / rate_hz))

    def set(self, name, value, kind=REAL32):
        self.say("param_set", 1, 1, name_bytes(name), to_wire(value, kind, self.vehicle.firmware.bytewise), kind)
        return self.hear(0.01)

    def hear(self, seconds):
        sent = self.vehicle.run_until(self.vehicle.now_us + round(seconds * S_US))
        return [packet.message for one in sent for packet in self._parser.datagram(one)]

    def rates(self, seconds=2.0):
        counts = Counter(message.get_type() for message in self.hear(seconds))
        return {name: count / seconds for name, count in counts.items()}

    def rest(self):
        """Have the hand set the vehicle down."""
        self.vehicle.receive(bytes(encode_prompt(ReceivedPrompt("lay_flat", None)).pack(self.mav)))
        self.hear(5.0)


# ArduPilot cuts intervals to whole ms, and keeps the last one when it denies; PX4 omits samples that come too early
@pytest.mark.parametrize(
    ("words", "name", "asked_hz", "result", "got_hz"),
    [
        ("imus=1", "HIGHRES_IMU", 300, ACCEPTED, 333),
        ("imus=1", "HIGHRES_IMU", 400, DENIED, 50),
        ("highres=no", "HIGHRES_IMU", 100, DENIED, 0),
        ("firmware=px4", "RAW_IMU", 100, FAILED, 0),
        ("firmware=px4", "SCALED_IMU", 200, ACCEPTED, 125),
    ],
)
def test_each_firmware_has_its_messages_and_rates(words, name, asked_hz, result, got_hz):
    station = Station(words)
    station.interval(MESSAGE_ID[name], 50)
    assert station.interval(MESSAGE_ID[name], asked_hz) == result
    assert station.rates().get(name, 0) == pytest.approx(got_hz, rel=0.02)


def test_whole_milli_g_are_truncated_toward_zero():
    station = Station("imus=1,highres=yes")
    station.rest()
    station.interval(HIGHRES, 100)
    station.interval(RAW, 100)
    messages = station.hear(1.0)
    exact = {m.time_usec: m for m in messages if m.get_type() == "HIGHRES_IMU"}
    pairs = [(m, exact[m.time_usec]) for m in messages if m.get_type() == "RAW_IMU" and m.time_usec in exact]
    assert len(pairs) > 90
    for raw, float_ in pairs:
        for axis in "xyz":
            assert getattr(raw, f"{axis}acc") == int(getattr(float_, f"{axis}acc") / 9.80665e-3)
            assert getattr(raw, f"{axis}gyro") == int(getattr(float_, f"{axis}gyro") * 1000)


@pytest.mark.parametrize("words", ["rotate_at=0,fault=reboot@2", "firmware=px4,fault=autocal@2"], ids=str)
def test_packets_are_the_same_for_any_steps_of_time(words):
    sent = []
    for stops_us in (range(2_500_000, 2_500_001), range(3000, 2_500_001, 1000), (700_000, 710_100, 2_500_000)):
        station = Station(words)
        for message_id in (HIGHRES, RAW, SCALED, SCALED2):
            station.interval(message_id, 100)
        station.set("CAL_ACC0_XOFF" if "px4" in words else "INS_ACCOFFS_X", 0.25)
        sent.append([packet for stop_us in stops_us for packet in station.vehicle.run_until(stop_us)])
    assert sent[0] == sent[1] == sent[2]
    assert len(sent[0]) > 300


@pytest.mark.parametrize("words", ["rotation=1", "firmware=px4,rotation=12"], ids=str)
def test_the_truth_it_tells_is_that_of_its_streams(words):
    station = Station(words)
    station.rest()
    station.interval(SCALED, 100)
    station.interval(SCALED2, 100)
    found = station.hear(2.0)
    first = station.vehicle.truth_document()
    for name, truth in (("SCALED_IMU", first), ("SCALED_IMU2", first["others"][0])):
        rows = [(m.xacc, m.yacc, m.zacc) for m in found if m.get_type() == name]
        mean = np.mean(np.array(rows) + 0.5 * np.sign(rows), axis=0) * 9.80665e-3
        # level, z down: gravity is felt upwards
        expected = np.array(truth["D"]) @ [0, 0, -9.80665] + truth["b_a"]
        np.testing.assert_allclose(mean, expected, atol=0.01)


def test_px4s_highres_imu_lacks_the_biases_that_the_estimator_learns():
    shift, turn = {}, {}
    for control in (7, 4):
        station = Station(f"firmware=px4,imus=1,EKF2_IMU_CTRL={control}")
        station.rest()
        station.interval(HIGHRES, 10)
        station.interval(SCALED, 10)
        station.hear(28.0)
        found = station.hear(2.0)
        exact, whole = (
            np.mean([(m.zacc, m.xgyro, m.ygyro, m.zgyro) for m in found if m.get_type() == name], axis=0)
            for name in ("HIGHRES_IMU", "SCALED_IMU")
        )
        hidden = exact - whole * [9.80665e-3, 1e-3, 1e-3, 1e-3]
        shift[control], turn[control] = abs(hidden[0]), np.linalg.norm(hidden[1:])
    assert shift[7] > 0.2
    assert shift[4] < 0.05
    # what is left of an estimated gyroscope's bias after 35 s of rest
    bias = np.linalg.norm(station.vehicle.imus.truths[0].b_omega)
    assert turn[7] > 0.5 * bias > turn[4]


def test_the_tool_puts_it_on_a_real_port(program):
    command = program("lab", "sim_vehicle", "tcp:127.0.0.1:0", "firmware=px4", "--speed", "4")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            url = running.stdout.readline().strip()
            transport = open_transport(parse_url(url))
            link = Link(transport, lambda t_ns, packet: None)
            for _ in range(10):  # the vehicle's process may wait for a processor
                with suppress(NoAnswer):
                    (vehicle,) = link.listen()
                    break
            assert vehicle.family == "PX4"
            link.close()
        finally:
            running.terminate()


def test_a_vehicle_that_is_opened_again_keeps_its_parameters():
    values = {"mavlink": "sim:firmware=px4,imus=1,CAL_ACC0_ID=0", "kept": {}}
    with open_source(values).connected(lambda text: None) as link:
        send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, 4)
    held = [open_source(each).contents()["parameters"] for each in (values, {**values, "kept": {}})]
    assert [each["CAL_ACC0_ID"] for each in held] == [DEVICE_IDS[0], 0]
    assert held[0]["CAL_ACC0_ZOFF"] != held[1]["CAL_ACC0_ZOFF"]
