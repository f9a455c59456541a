from itertools import chain

import numpy as np
import pytest
from scipy.signal import butter, group_delay

from mpucal.errors import EndOfCapture, LinkError, UsageError, WriteBackError
from mpucal.mavlink.firmwares import ARDUPILOT
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.client import ParameterClient
from mpucal.mavlink.parameters.mounting import mounting
from mpucal.mavlink.parameters.slots import ardupilot_slot
from mpucal.mavlink.stream_parameters import read_stream_parameters, stream_parameter_names
from mpucal.mavlink.tlog import Record, Tlog
from mpucal.mavlink.tlog_replay import TlogReplay
from mpucal.mavlink.vehicle_source import VehicleSource
from mpucal.session.plan import Plan
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport
from mpucal.sources.vehicle import OpenedVehicle


def opened(words="", system=None):
    """A source on a simulated vehicle, what it records, and what it says."""
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}" if words else "sim"))
    record, said = [], []
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: record.append(Record(t_ns, data)))
    return VehicleSource(link, 100.0, system, said.append, "test"), record, said


def polled(source, seconds):
    return list(chain.from_iterable(source.poll().t for _ in range(round(20 * seconds))))


@pytest.mark.parametrize(
    ("words", "messages"),
    [
        ("", ["HIGHRES_IMU", "SCALED_IMU2"]),
        ("highres=no,imus=3", ["RAW_IMU", "SCALED_IMU2", "SCALED_IMU3"]),
        ("firmware=px4", ["SCALED_IMU", "SCALED_IMU2"]),
    ],
    ids=["new ArduPilot", "old ArduPilot", "PX4"],
)
def test_all_imus_are_recorded_by_their_truest_streams(words, messages):
    source, _, said = opened(words)
    sensor = source.start()
    assert sensor.message == messages[0]
    assert "system 1" in said[0]
    t = polled(source, 3)
    assert np.diff(t) == pytest.approx(0.01, abs=3e-3)
    recording = source.recording()
    recordings = [recording, *recording.others]
    assert [r.autopilot.message for r in recordings] == messages
    assert [r.autopilot.imu for r in recordings] == list(range(1, len(messages) + 1))
    assert [r.t[-1] for r in recordings] == pytest.approx([t[-1]] * len(messages), abs=0.02)
    assert set(t) <= set(recording.t)


def test_the_parameters_that_shape_the_stream_are_read_first():
    source, _, _ = opened("INS_ACCOFFS_X=0.25")
    source.start()
    polled(source, 1)
    parameters = source.recording().autopilot.parameters
    assert parameters["INS_ACCOFFS_X"] == 0.25
    assert {"AHRS_ORIENTATION", "INS_ACC2SCAL_Z"} <= set(parameters)


@pytest.mark.parametrize("seed", range(6))
def test_no_parameter_is_given_up_where_one_packet_in_five_is_lost(seed):
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:imus=1,fault=loss,seed={seed}"))
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None)
    link.lock(link.listen()[0])
    assert set(read_stream_parameters(link, ARDUPILOT)) == set(stream_parameter_names(ARDUPILOT))


def test_the_angles_of_a_board_that_is_turned_by_its_own_are_asked_for():
    source, _, _ = opened("imus=1,rotation=101,CUST_ROT1_ROLL=180,CUST_ROT1_YAW=90")
    source.start()
    polled(source, 1)
    R_b = mounting(ARDUPILOT, ardupilot_slot(1), source.recording().autopilot.parameters)
    # turned over its nose, then to the right: its x points to the vehicle's y, its y to x, its z up
    np.testing.assert_allclose(R_b, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)


@pytest.mark.parametrize(
    ("words", "cutoffs_hz"),
    [("", (20, 20)), ("INS_GYRO_FILTER=40", (20, 40)), ("type=rover", (10, 4)), ("INS_ACCEL_FILTER=0", (0, 20))],
)
def test_the_filters_tell_by_how_much_both_sensors_are_apart(words, cutoffs_hz):
    source, _, _ = opened(f"imus=1,hand=still,{words}".strip(","))
    sensor = source.start()
    polled(source, 0.5)
    # of the filters as they are computed, at 400 Hz, for what is slow
    delays = [group_delay(butter(2, f, fs=400.0), [0.1], fs=400.0)[1][0] / 400.0 if f else 0.0 for f in cutoffs_hz]
    for lag_s in (sensor.accel_lag_s, source.recording().sensor.accel_lag_s):
        assert lag_s == pytest.approx(delays[0] - delays[1], abs=2e-4)


@pytest.mark.parametrize("words", ["type=plane", "type=rover", "firmware=px4,type=plane"])
def test_planes_and_rovers_are_measured_like_copters(words):
    source, _, said = opened(f"imus=1,hand=still,fault=arm@8,{words}")
    source.start()
    assert len(polled(source, 5)) > 450
    assert [text for text in said if "was armed" in text]


def test_a_still_quantised_gyro_is_not_believed_to_be_without_noise():
    source, _, _ = opened("highres=no")
    # of the live fits and of the last one
    assert min(source.start().least_noise) > 0.0
    polled(source, 3)
    recording = source.recording()
    assert min(recording.sensor.least_noise) > 0.0
    assert min(recording.sensor.steps) > 0.0
    assert recording.flat is not None


# the loss is told once 2000 packets were sent: 10 s of two IMUs
@pytest.mark.parametrize(("fault", "seconds"), [("loss", 12), ("reorder", 3), ("duplicate", 3)])
def test_faults_of_the_line_leave_samples_in_order(fault, seconds):
    source, _, said = opened(f"fault={fault}")
    source.start()
    t = polled(source, seconds)
    assert (np.diff(t) > 0).all()
    recording = source.recording()
    assert (np.diff(recording.t) > 0).all()
    assert not recording.gap.any()
    # late samples are missing while it measures, and in their places at the end
    lost = 0.2 if fault == "loss" else 0.0
    assert len(recording) == pytest.approx((1.0 - lost) * (seconds + 1) * 100, rel=0.1)
    assert [text for text in said if "loses" in text] == ([f for f in said if "% of the packets" in f] if lost else [])


def test_a_replay_gives_the_same_samples_poll_by_poll():
    source, record, _ = opened("highres=no,fault=loss,fault=reorder")
    first = [source.start(), *(source.poll().t.tolist() for _ in range(60))]
    link = Link(TlogReplay(Tlog(tuple(record), "capture.tlog", None)), lambda t_ns, data: None)
    again = VehicleSource(link, 100.0, None, lambda text: None, "test")
    assert [again.start(), *(again.poll().t.tolist() for _ in range(59))] == first[:-1]
    with pytest.raises(EndOfCapture):
        for _ in range(3):
            again.poll()
    np.testing.assert_array_equal(again.recording().acc, source.recording().acc)


def test_a_vehicle_that_falls_silent_is_waited_for_and_then_one_sentence():
    source, _, said = opened("imus=1,fault=silence@5")
    source.start()
    with pytest.raises(LinkError, match=r"system 1 \(ArduPilot\) at the simulated vehicle has sent nothing for 3\d s"):
        polled(source, 60)
    assert [text for text in said if "has sent nothing for 4 s: wait until it is back" in text]


def test_arming_is_said_at_once_and_does_not_end_it():
    source, _, said = opened("imus=1,fault=arm@8")
    source.start()
    polled(source, 8)
    assert [text for text in said if "was armed: keep clear of its propellers" in text] == said[1:]
    assert len(said) == 2


@pytest.mark.parametrize("words", ["imus=2,fault=reboot@6", "firmware=px4,fault=reboot@6"])
def test_after_a_reboot_its_streams_are_asked_for_again_and_join(words):
    source, record, said = opened(words)
    source.start()
    t = polled(source, 13)
    assert [text.partition(": ")[2] for text in said if "rebooted" in text] == [
        "wait until it is back, and hold it still meanwhile."
    ]
    assert "is back, its parameters are read again" in said[-1]
    assert (np.diff(t) > 0).all()
    recording = source.recording()
    for one in (recording, *recording.others):
        assert one.gap.sum() == 1
        before = int(np.flatnonzero(one.gap)[0])
        # as long as the silence, and what it took to notice that the streams had ended
        assert 2.0 < one.t[before] - one.t[before - 1] < 6.0
        assert len(one) - before > 300
    link = Link(TlogReplay(Tlog(tuple(record), "capture.tlog", None)), lambda t_ns, data: None)
    again = VehicleSource(link, 100.0, None, lambda text: None, "test")
    again.start()
    repeated = polled(again, 11)
    assert repeated == t[: len(repeated)]


@pytest.mark.parametrize("words", ["", ",CAL_ACC0_ID=0"], ids=["named", "named meanwhile"])
def test_offsets_that_px4_commits_meanwhile_are_composed(words):
    source, _, said = opened(f"firmware=px4,imus=1,fault=autocal@9,hand=still{words}")
    source.start()
    polled(source, 10)
    assert [text for text in said if "was changed while it was measured" in text and "SENS_IMU_AUTOCAL" in text]
    recording = source.recording()
    new = recording.autopilot.parameters
    assert abs(new["CAL_ACC0_XOFF"]) + abs(new["CAL_ACC0_YOFF"]) + abs(new["CAL_ACC0_ZOFF"]) > 0.02
    (cut,) = np.flatnonzero(recording.gap)
    # before the change as after it: as if the new offsets had been there all the time
    np.testing.assert_allclose(recording.acc[:cut].mean(0), recording.acc[cut:].mean(0), atol=0.01)
    assert np.linalg.norm([new[f"CAL_GYRO0_{axis}OFF"] for axis in "XYZ"]) > 2e-3
    np.testing.assert_allclose(recording.gyr[:cut].mean(0), recording.gyr[cut:].mean(0), atol=5e-4)


def test_another_system_is_not_locked_to():
    source, _, _ = opened(system=9)
    with pytest.raises(UsageError, match="no vehicle is system 9"):
        source.start()


def test_a_stream_of_zeros_is_no_imu():
    source, _, _ = opened("imus=2,fault=phantom")
    source.start()
    polled(source, 2)
    recording = source.recording()
    assert [one.autopilot.imu for one in (recording, *recording.others)] == [1, 2]


@pytest.mark.parametrize("writes", [True, False])
def test_a_px4_that_names_no_sensor_is_told_before_anything_is_turned(writes):
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:firmware=px4,imus=1,CAL_ACC0_ID=0"))
    said = []
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None)
    source = VehicleSource(link, 100.0, None, said.append, "test", writes)
    if writes:
        with pytest.raises(WriteBackError, match=r"all CAL_ACCn_ID are 0.*nothing was measured"):
            source.start()
    else:
        source.start()
        assert "the result is for files only" in said[-1]


def test_a_px4_that_was_prepared_names_its_sensors_and_holds_its_offsets():
    words = ",".join(f"CAL_ACC{imu}_ID=0" for imu in range(2))
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:firmware=px4,imus=2,hand=still,fault=autocal@12,{words}"))
    said, record = [], []
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: record.append(Record(t_ns, data)))
    source = VehicleSource(link, 100.0, None, said.append, "test", writes=True, prepare=True)
    source.start()
    assert vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 0
    t = polled(source, 8)
    assert not [text for text in said if "was changed" in text]
    recording = source.recording()
    assert [one.autopilot.parameters["CAL_ACC1_ID"] > 0 for one in (recording, *recording.others)] == [True, True]
    source.stop()
    assert vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 1
    link = Link(TlogReplay(Tlog(tuple(record), "capture.tlog", None)), lambda t_ns, data: None)
    again = VehicleSource(link, 100.0, None, lambda text: None, "test", prepare=True)
    again.start()
    repeated = polled(again, 6)
    assert repeated == t[: len(repeated)]


def test_the_truth_after_a_preparation_is_that_of_what_was_measured(tmp_path):
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:firmware=px4,imus=1,CAL_ACC0_ID=0"))
    opened = OpenedVehicle(SimulatedTransport(vehicle), Plan(), truth=vehicle.truth_document, prepare=True)
    fresh = opened.truth
    with opened.measuring(tmp_path / "capture.tlog", lambda text: None, "") as measuring:
        measuring.source.start()
        polled(measuring.source, 3)
        recording = measuring.source.recording()
    truth = opened.truth
    assert np.linalg.norm(np.subtract(truth["b_a"], fresh["b_a"])) > 0.1
    # as it lies: level but for what a table is off by
    expected = np.array(truth["D"]) @ [0, 0, -9.80665] + truth["b_a"]
    np.testing.assert_allclose(recording.acc.mean(0), expected, atol=0.03)


def test_a_px4_that_does_not_lie_level_is_not_asked_to_name_its_sensors():
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:firmware=px4,imus=1,hand=still,CAL_ACC0_ID=0"))
    # who holds it hears nothing, and goes on holding it tilted
    vehicle.imus.hear = lambda prompt, t_s: None
    said = []
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None)
    VehicleSource(link, 100.0, None, said.append, "test", prepare=True).start()
    assert [text for text in said if "did not lie level" in text]
    assert vehicle.firmware.store["CAL_ACC0_ID"] == 0
    assert not np.any(vehicle.firmware.store.vector("CAL_ACC0_", "OFF"))


def test_autocal_is_set_back_where_the_answer_to_holding_it_is_lost(monkeypatch):
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:firmware=px4,imus=1,hand=still"))
    set_surely = ParameterClient.set

    def lost(self, name, value, kind):
        set_surely(self, name, value, kind)
        if value == 0:
            raise LinkError("no answer", "ask again")

    monkeypatch.setattr(ParameterClient, "set", lost)
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None)
    source = VehicleSource(link, 100.0, None, lambda text: None, "test", prepare=True)
    with pytest.raises(LinkError):
        source.start()
    assert vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 0
    source.stop()
    assert vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 1


def test_an_ardupilot_is_told_that_nothing_was_prepared():
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:imus=1,hand=still"))
    said = []
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None)
    VehicleSource(link, 100.0, None, said.append, "test", prepare=True).start()
    assert [text for text in said if "nothing was prepared" in text]


@pytest.mark.parametrize(("asked_hz", "came_hz"), [(100, 100), (125, 125), (200, 250), (250, 250)])
def test_px4_is_asked_so_that_most_arrives(asked_hz, came_hz):
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:firmware=px4,imus=1,hand=still"))
    source = VehicleSource(
        Link(SimulatedTransport(vehicle), lambda t_ns, data: None), asked_hz, None, lambda text: None, "test"
    )
    source.start()
    assert len(polled(source, 3)) / 3 == pytest.approx(came_hz, rel=0.05)


@pytest.mark.parametrize("own", [254, 255])
def test_an_ardupilot_that_hears_one_station_alone(own):
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:imus=1,MAV_OPTIONS=1"))
    link = Link(SimulatedTransport(vehicle), lambda t_ns, data: None, None, own)
    source = VehicleSource(link, 100.0, None, lambda text: None, "test")
    if own == 255:
        assert source.start().message == "HIGHRES_IMU"
    else:
        with pytest.raises(LinkError, match=r"answers nothing to system 254.*MAV_OPTIONS 1.*--source-system"):
            source.start()


def test_what_was_slow_from_the_beginning_is_asked_for_again():
    source, _, said = opened("imus=2,fault=second_station@0.5")
    vehicle_at_4_hz = "SCALED_IMU2 was slowed down"
    source.start()
    polled(source, 20)
    assert [text for text in said if vehicle_at_4_hz in text]
    second = source.recording().others[0]
    assert second.rate_hz > 60
