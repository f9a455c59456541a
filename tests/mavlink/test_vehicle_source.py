"""The source of a vehicle's samples, on simulated vehicles with the faults of vehicles and links."""

from itertools import chain

import numpy as np
import pytest
import scipy

from mpucal.errors import EndOfCapture, LinkError, WriteBackError
from mpucal.mavlink import px4_preparation
from mpucal.mavlink.firmwares import ARDUPILOT
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.mounting import mounting
from mpucal.mavlink.parameters.slots import ardupilot_slot
from mpucal.mavlink.requests import check_prearm
from mpucal.mavlink.vehicle_source import VehicleSource
from mpucal.sources.replay import PacketReplay


@pytest.fixture
def opened(simulated):
    """opened(words) returns a source on a simulated vehicle, with its messages in `said`."""

    def make(words="", system=None, rate_hz=100.0, own_system=254, **options):
        to = simulated(words, lock=False, own_system=own_system)
        to.said = []
        to.source = VehicleSource(to.link, rate_hz, system, to.said.append, "test", **options)
        return to

    return make


def started(to, seconds=0.0):
    """Start its source and poll for that long; return the times of the samples."""
    to.source.start()
    return polled(to.source, seconds)


def polled(source, seconds):
    return list(chain.from_iterable(source.poll().t for _ in range(round(20 * seconds))))


def replay_of(to, **options):
    """Return a source on what the link recorded."""
    link = Link(PacketReplay(to.record, "capture.mcap"), lambda t_ns, data: None)
    return VehicleSource(link, 100.0, None, lambda text: None, "test", **options)


@pytest.mark.parametrize(
    ("words", "messages"),
    [
        ("", ["HIGHRES_IMU", "SCALED_IMU2"]),
        ("highres=no,imus=3", ["RAW_IMU", "SCALED_IMU2", "SCALED_IMU3"]),
        ("firmware=px4", ["SCALED_IMU", "SCALED_IMU2"]),
    ],
    ids=["new ArduPilot", "old ArduPilot", "PX4"],
)
def test_all_imus_are_recorded_by_their_truest_streams(opened, words, messages):
    to = opened(words)
    assert to.source.start().message == messages[0]
    assert "system 1" in to.said[0]
    t = polled(to.source, 3)
    assert np.diff(t) == pytest.approx(0.01, abs=3e-3)
    recording = to.source.recording()
    recordings = [recording, *recording.others]
    assert [r.autopilot.message for r in recordings] == messages
    assert [r.autopilot.imu for r in recordings] == list(range(1, len(messages) + 1))
    assert [r.t[-1] for r in recordings] == pytest.approx([t[-1]] * len(messages), abs=0.02)
    assert set(t) <= set(recording.t)
    # That of IMU 1 is its own, and not the barometer's of HIGHRES_IMU.
    assert [r.temperature_c[-1] for r in recordings] == pytest.approx([26.2] * len(messages), abs=0.5)


def test_the_angles_of_a_board_that_is_turned_by_its_own_are_asked_for(opened):
    to = opened("imus=1,rotation=101,CUST_ROT1_ROLL=180,CUST_ROT1_YAW=90", prepare=True)
    started(to, 1)
    assert [text for text in to.said if "nothing was prepared" in text]
    R_b = mounting(ARDUPILOT, ardupilot_slot(1), to.source.recording().autopilot.parameters)
    # turned over its nose, then to the right: its x points to the vehicle's y, its y to x, its z up
    np.testing.assert_allclose(R_b, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)


@pytest.mark.parametrize(
    ("words", "cutoffs_hz"),
    [("INS_GYRO_FILTER=40", (20, 40)), ("type=rover", (10, 4)), ("INS_ACCEL_FILTER=0", (0, 20))],
)
def test_the_filters_tell_by_how_much_both_sensors_are_apart(opened, words, cutoffs_hz):
    source = opened(f"imus=1,hand=still,{words}".strip(",")).source
    sensor = source.start()
    polled(source, 0.5)
    # of the filters as they are computed, at 400 Hz, for what is slow
    delays = [
        scipy.signal.group_delay(scipy.signal.butter(2, f, fs=400.0), [0.1], fs=400.0)[1][0] / 400.0 if f else 0.0
        for f in cutoffs_hz
    ]
    for lag_s in (sensor.accel_lag_s, source.recording().sensor.accel_lag_s):
        assert lag_s == pytest.approx(delays[0] - delays[1], abs=2e-4)


@pytest.mark.parametrize(("firmware", "late"), [("ardupilot", True), ("px4", False)])
def test_the_times_of_sending_are_not_believed_to_be_those_of_the_samples(opened, firmware, late):
    source = opened(f"firmware={firmware}").source
    of_session = source.start()
    polled(source, 0.5)
    assert [each.time_std > 0.0 for each in (of_session, source.recording().sensor)] == [late, late]


def test_a_still_quantised_gyro_is_not_believed_to_be_without_noise(opened):
    source = opened("highres=no").source
    # for the live fits and the final one
    assert min(source.start().least_noise) > 0.0
    polled(source, 3)
    recording = source.recording()
    assert min(recording.sensor.least_noise) > 0.0
    assert min(recording.sensor.steps) > 0.0
    assert recording.flat is not None


# the loss is reported after 2000 packets: 10 s of two IMUs
@pytest.mark.parametrize(("fault", "seconds"), [("loss", 12), ("reorder,fault=duplicate", 3)])
def test_faults_of_the_line_leave_samples_in_order(opened, fault, seconds):
    to = opened(f"fault={fault}")
    assert (np.diff(started(to, seconds)) > 0).all()
    recording = to.source.recording()
    assert (np.diff(recording.t) > 0).all()
    assert not recording.gap.any()
    # late samples are missing while it measures, and in their places at the end
    lost = 0.2 if fault == "loss" else 0.0
    assert len(recording) == pytest.approx((1.0 - lost) * (seconds + 1) * 100, rel=0.1)
    assert len([text for text in to.said if "loses" in text and "% of the packets" in text]) == bool(lost)


def test_a_replay_gives_the_same_samples_poll_by_poll(opened):
    to = opened("highres=no,fault=loss,fault=reorder")
    first = [to.source.start(), *(to.source.poll().t.tolist() for _ in range(60))]
    again = replay_of(to)
    assert [again.start(), *(again.poll().t.tolist() for _ in range(59))] == first[:-1]
    with pytest.raises(EndOfCapture):
        for _ in range(3):
            again.poll()
    np.testing.assert_array_equal(again.recording().acc, to.source.recording().acc)


def test_a_vehicle_that_falls_silent_is_waited_for_and_then_one_sentence(opened):
    to = opened("imus=1,fault=silence@5")
    with pytest.raises(LinkError, match=r"system 1 \(ArduPilot\) at the simulated vehicle has sent nothing for 3\d s"):
        started(to, 60)
    assert [text for text in to.said if "has sent nothing for 4 s: wait until it is back" in text]


def test_arming_is_reported_at_once_and_does_not_end_the_session(opened):
    to = opened("firmware=px4,type=plane,imus=1,hand=still,fault=arm@8")
    assert len(started(to, 8)) > 750
    assert [text for text in to.said if "was armed: keep clear of its propellers" in text] == to.said[1:]
    assert len(to.said) == 2


@pytest.mark.parametrize("parts", [1, 2])
def test_the_share_of_lost_packets_is_that_of_the_part_in_which_it_is_reported(opened, parts):
    to = opened("imus=1,hand=still")
    to.link.lost = 100_000
    for _ in range(parts):
        started(to, 25)
    assert not [text for text in to.said if "loses" in text]
    to.link.lost += 300
    polled(to.source, 0.1)
    share = 300 / (300 + to.link.received)
    assert [text for text in to.said if "loses" in text] == [
        f"The link loses {100 * share:.0f} % of the packets: a nearer or faster one is better."
    ]
    assert 0.05 < share < 0.15


def test_streams_are_requested_again_after_a_reboot_and_joined(opened):
    to = opened("imus=2,fault=reboot@6")
    t = started(to, 13)
    assert [text.partition(": ")[2] for text in to.said if "rebooted" in text] == [
        "wait until it is back, and hold it still meanwhile."
    ]
    assert "is back, its parameters are read again" in to.said[-1]
    assert (np.diff(t) > 0).all()
    recording = to.source.recording()
    for one in (recording, *recording.others):
        assert one.gap.sum() == 1
        before = int(np.flatnonzero(one.gap)[0])
        # the silence, and the time until it was noticed
        assert 2.0 < one.t[before] - one.t[before - 1] < 6.0
        assert len(one) - before > 300
    again = replay_of(to)
    again.start()
    repeated = polled(again, 11)
    assert repeated == t[: len(repeated)]


def test_offsets_that_px4_commits_meanwhile_are_composed(opened):
    to = opened("firmware=px4,imus=1,fault=autocal@9,hand=still,arm=steady")
    started(to, 10)
    assert [text for text in to.said if "was changed while it was measured" in text and "SENS_IMU_AUTOCAL" in text]
    recording = to.source.recording()
    new = recording.autopilot.parameters
    assert sum(abs(new[f"CAL_ACC0_{axis}OFF"]) for axis in "XYZ") > 0.02
    (cut,) = np.flatnonzero(recording.gap)
    # the samples before the change are converted to the new offsets
    np.testing.assert_allclose(recording.acc[:cut].mean(0), recording.acc[cut:].mean(0), atol=0.01)
    assert np.linalg.norm([new[f"CAL_GYRO0_{axis}OFF"] for axis in "XYZ"]) > 2e-3
    np.testing.assert_allclose(recording.gyr[:cut].mean(0), recording.gyr[cut:].mean(0), atol=5e-4)


def test_a_stream_of_zeros_is_no_imu(opened):
    to = opened("imus=2,fault=phantom")
    started(to, 2)
    recording = to.source.recording()
    assert [one.autopilot.imu for one in (recording, *recording.others)] == [1, 2]


def test_a_px4_without_sensor_ids_is_refused_before_it_is_turned(opened):
    fresh = "firmware=px4,imus=1,CAL_ACC0_ID=0"
    with pytest.raises(WriteBackError, match=r"all CAL_ACCn_ID are 0.*nothing was measured"):
        opened(fresh, writes=True).source.start()
    to = opened(fresh, writes=False)
    to.source.start()
    assert "the result is for files only" in to.said[-1]


def test_a_px4_that_was_prepared_names_its_sensors_and_holds_its_offsets(opened):
    words = "firmware=px4,imus=2,hand=still,fault=autocal@12,CAL_ACC0_ID=0,CAL_ACC1_ID=0"
    to = opened(words, writes=True, prepare=True)
    to.source.start()
    assert to.vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 0
    t = polled(to.source, 8)
    assert not [text for text in to.said if "was changed" in text]
    recording = to.source.recording()
    assert [one.autopilot.parameters["CAL_ACC1_ID"] > 0 for one in (recording, *recording.others)] == [True, True]
    to.source.stop()
    assert to.vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 1
    again = replay_of(to, prepare=True)
    again.start()
    repeated = polled(again, 6)
    assert repeated == t[: len(repeated)]


def test_a_px4_that_does_not_lie_level_is_not_asked_to_name_its_sensors(opened):
    to = opened("firmware=px4,imus=1,hand=still,CAL_ACC0_ID=0", prepare=True)
    # a hand that receives no prompt goes on holding it tilted
    to.vehicle.imus.hear = lambda prompt, t_s: None
    to.source.start()
    assert [text for text in to.said if "did not lie level" in text]
    assert to.vehicle.firmware.store["CAL_ACC0_ID"] == 0
    assert not np.any(to.vehicle.firmware.store.vector([f"CAL_ACC0_{axis}OFF" for axis in "XYZ"]))


def test_autocal_is_set_back_where_the_answer_to_holding_it_is_lost(opened, monkeypatch):
    to, set_surely = opened("firmware=px4,imus=1,hand=still", prepare=True), px4_preparation.set_parameter

    def lost(link, name, value, kind):
        set_surely(link, name, value, kind)
        if value == 0:
            raise LinkError("no answer", "ask again")

    monkeypatch.setattr(px4_preparation, "set_parameter", lost)
    with pytest.raises(LinkError):
        to.source.start()
    assert to.vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 0
    to.source.stop()
    assert to.vehicle.firmware.store["SENS_IMU_AUTOCAL"] == 1


def test_px4s_interval_is_requested_so_that_most_samples_arrive(opened):
    to = opened("firmware=px4,imus=1,hand=still", rate_hz=200)
    assert len(started(to, 3)) / 3 == pytest.approx(250, rel=0.05)


def test_a_stream_that_is_slow_from_the_beginning_is_requested_again(opened):
    to = opened("imus=2,hand=still,fault=second_station@0.5")
    started(to, 20)
    # the second station has it sent at 4 Hz
    assert [text for text in to.said if "SCALED_IMU2 was slowed down" in text]
    assert to.source.recording().others[0].rate_hz > 60


@pytest.mark.parametrize("words", ["", ",CAL_ACC0_ID=0"], ids=["ready", "a sensor without a slot"])
def test_px4_says_whether_it_would_arm_though_it_does_not_list_the_check(simulated, words):
    px4 = simulated(f"firmware=px4{words}")
    assert not px4.vehicle.firmware.sys_status().onboard_control_sensors_present & 0x10000000
    assert check_prearm(px4.link).ready is not bool(words)


def test_a_reason_that_got_lost_on_the_link_is_asked_for_again(simulated, monkeypatch):
    uncalibrated = simulated("firmware=ardupilot,INS_ACCOFFS_X=0,INS_ACCOFFS_Y=0,INS_ACCOFFS_Z=0")
    (complaint,) = uncalibrated.vehicle.firmware.complaints()
    send, lost = uncalibrated.vehicle._send, []

    def lose_first_reason(message):
        if message.get_type() == "STATUSTEXT" and not lost:
            lost.append(message)
        else:
            send(message)

    monkeypatch.setattr(uncalibrated.vehicle, "_send", lose_first_reason)
    state = check_prearm(uncalibrated.link)
    assert (state.ready, [f"PreArm: {each}" for each in state.complaints], len(lost)) == (False, [complaint], 1)
