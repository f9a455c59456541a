"""A calibration written into simulated vehicles: the new parameters or the old ones, and the exit code says which."""

import copy
import copyreg
import os
import re
import signal
from dataclasses import replace
from functools import cache
from struct import Struct
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.cli.summary import summary
from mpucal.data import Autopilot
from mpucal.errors import LinkError, WriteBackError
from mpucal.mavlink import rest as rest_monitor
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.mavlink.requests import interval_command, send_command
from mpucal.mavlink.rest import Horizon
from mpucal.mavlink.texts import ReceivedPrompt, encode_prompt
from mpucal.mavlink.transports import ReceivedBytes
from mpucal.result.calibration import Calibration
from mpucal.result.journal import Journal
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import ADDRESS, SimulatedTransport
from mpucal.sinks.table import SINKS
from mpucal.sinks.write_back import write_to
from mpucal.vehicle.sink import AutopilotSink
from tools.attack import hostile_vehicle as hostile

FIRMWARES = ("ardupilot", "px4")
LEVELLED = {
    "ardupilot": ",AHRS_TRIM_X=0.03,AHRS_TRIM_Y=-0.05,AHRS_TRIM_Z=0.01",
    "px4": ",SENS_BOARD_X_OFF=1.7,SENS_BOARD_Y_OFF=-2.9,SENS_BOARD_Z_OFF=0.6",
}
SCALED = ("SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")
REFUSED = {"verdict": "refused", "reasons": []}


class Flying(SimulatedTransport):
    """The simulated vehicle, where `on_set` sees each PARAM_SET that is sent, and may swallow it."""

    def __init__(self, vehicle):
        super().__init__(vehicle)
        self.vehicle, self.sets, self.on_set = vehicle, 0, lambda number, message: True
        self._parser = Parser(dialect().MAVLink(None))

    def send(self, data, address):
        for packet in self._parser.datagram(data):
            if packet.message.get_type() == "PARAM_SET":
                self.sets += 1
                if not self.on_set(self.sets, packet.message):
                    return
        super().send(data, address)


# pymavlink's MAVLink, which is copied with a link, holds some
copyreg.pickle(Struct, lambda packing: (Struct, (packing.format,)))


@cache
def settled(firmware, words):
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:firmware={firmware}{words}"))
    transport = Flying(vehicle)
    link = Link(transport, recorded_nowhere)
    link.lock(link.listen()[0])
    link.send(encode_prompt(ReceivedPrompt("lay_flat", None)))
    list(link.messages(link.now_ns() + 4_000_000_000))
    return vehicle, transport, link


def recorded_nowhere(t_ns, packet):
    pass


def vehicle_of(firmware, words=""):
    """A vehicle that was set down, behind a locked link."""
    return copy.deepcopy(settled(firmware, words))


@pytest.fixture(autouse=True)
def brief(monkeypatch):
    """Shorten the observation of streams at rest to a fifth, in tests that do not depend on its length."""
    monkeypatch.setattr(rest_monitor, "WINDOW_NS", rest_monitor.WINDOW_NS // 5)
    monkeypatch.setattr(rest_monitor, "FEWEST", rest_monitor.FEWEST // 5)


def calibration_of(vehicle):
    """Return the calibration of a perfect fit of its streams."""
    firmware = vehicle.firmware
    name = "PX4" if firmware.bytewise else "ArduPilot"
    parameters = {key: float(firmware.store[key]) for key in firmware.store}
    made = []
    for imu in range(vehicle.options.imus):
        truth = vehicle.imus.truth(imu, *firmware.correction(imu), firmware.mounting)
        message = SCALED[imu] if firmware.bytewise or imu else "HIGHRES_IMU"
        one = Calibration(
            np.array(truth["D"]),
            np.array(truth["b_a"]),
            fit={"gravity": 9.80665},
            quality={"verdict": "good", "reasons": []},
        )
        autopilot = autopilot_document(Autopilot(name, imu + 1, message, parameters), one)
        made.append(replace(one, extra=MappingProxyType({"autopilot": autopilot})))
    first, *others = made
    extra = {**first.extra, "others": [other.document() for other in others]}
    return replace(first, extra=MappingProxyType(extra))


def stored(vehicle):
    """Return the parameters that correct its accelerometers, and its level."""
    pattern = re.compile(r"(OFFS|SCAL|TRIM)_[XYZ]$|[XYZ](OFF|SCALE)$|SENS_BOARD_[XYZ]_OFF$")
    return {name: vehicle.firmware.store[name] for name in vehicle.firmware.store if pattern.search(name)}


def error_mps2(vehicle, imu=0):
    """Return the largest error of |a| of its stream over all attitudes."""
    truth = vehicle.imus.truth(imu, *vehicle.firmware.correction(imu))
    points = np.random.default_rng(1).normal(size=(500, 3))
    f = 9.80665 * points / np.linalg.norm(points, axis=1, keepdims=True)
    return np.abs(np.linalg.norm(f @ np.array(truth["D"]).T + truth["b_a"], axis=1) - 9.80665).max()


def test_a_vehicle_that_is_slow_for_a_moment_is_waited_for(monkeypatch):
    _, _, link = vehicle_of("ardupilot")
    # It sends 4 Hz, as a simulator on a busy computer does: its windows are longer than usual.
    monkeypatch.setattr(rest_monitor, "interval_command", lambda name: interval_command(name, 250_000))
    begun_ns, stream = link.now_ns(), rest_monitor.Stream("HIGHRES_IMU", 1)
    rest = rest_monitor.RestMonitor(link, [stream]).wait()
    assert np.linalg.norm(rest.mean[stream]) == pytest.approx(9.8, abs=0.8)
    assert 2 * rest_monitor.FEWEST / 4.0 < (link.now_ns() - begun_ns) / 1e9 < rest_monitor.PATIENCE_NS / 1e9


@pytest.mark.parametrize(("firmware", "words"), [("ardupilot", ",highres=no"), ("px4", ",imus=3,rotation=1")])
def test_every_imu_reads_gravity_better_and_a_second_write_changes_nothing(firmware, words):
    vehicle, transport, link = vehicle_of(firmware, words)
    calibration = calibration_of(vehicle)
    if "highres=no" in words:
        # as of a dataflash log: the write is verified by RAW_IMU and SCALED_IMU2
        for document in (calibration.extra, *calibration.extra["others"]):
            document["autopilot"]["message"] = "IMU"
    before = [error_mps2(vehicle, imu) for imu in range(vehicle.options.imus)]
    sink = AutopilotSink(link, confirm=yes)
    applied = sink.write(calibration)
    said = [calibration.extra["autopilot"], *(other["autopilot"] for other in calibration.extra["others"])]
    for imu, autopilot in enumerate(said):
        assert error_mps2(vehicle, imu) < 0.5 * before[imu]
        assert error_mps2(vehicle, imu) == pytest.approx(autopilot["residual_mps2"], rel=0.1, abs=0.01)
    assert "would arm" in applied.what.rpartition("now it ")[2]
    # the returned calibration is of the present streams
    truth = vehicle.truth_document()
    np.testing.assert_allclose(applied.calibration.D, truth["D"], atol=1e-6)
    np.testing.assert_allclose(applied.calibration.b_a, truth["b_a"], atol=1e-6)
    once, sets = stored(vehicle), transport.sets
    sink.write(applied.calibration)
    assert (stored(vehicle), transport.sets) == (once, sets)


def yes(question, with_yes):
    return with_yes


def attitude_deg(vehicle, link):
    """Return the mean roll and pitch of a second of ATTITUDE."""
    send_command(link, *interval_command("ATTITUDE"))
    heard = [m for m in link.messages(link.now_ns() + 1_000_000_000) if m.get_type() == "ATTITUDE"]
    return np.degrees(np.mean([(m.roll, m.pitch) for m in heard], axis=0))


@pytest.mark.parametrize(("firmware", "since"), [("ardupilot", False), ("px4", False), ("px4", True)])
def test_a_levelled_vehicle_is_level_again_after_the_write_and_its_reboot(firmware, since):
    vehicle, _, link = vehicle_of(firmware, ",imus=1")
    calibration = calibration_of(vehicle)
    assert send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, 2) == 0
    # a bias that the estimator learnt with the old offsets
    vehicle.firmware.bias = np.array([0.2, -0.3, 0.1])
    old_deg = vehicle.firmware.trim_deg
    questions, tilted = [], []

    def agree(question, with_yes):
        questions.append(question)
        if question.startswith("Reboot"):
            tilted.append(attitude_deg(vehicle, link))
        return with_yes

    applied = AutopilotSink(link, confirm=agree).write(calibration if since else calibration_of(vehicle))
    assert np.abs(vehicle.firmware.trim_deg - old_deg).max() > 0.5
    np.testing.assert_allclose(applied.calibration.D, vehicle.truth_document()["D"], atol=1e-6)
    assert np.abs(tilted[0]).max() > 1
    assert np.abs(attitude_deg(vehicle, link)).max() < 0.2
    assert [q.split()[0] for q in questions] == ["system", "Reboot"]
    said = r"what was level stays level .* horizon agrees with gravity within 0\.0\d deg, and it shows .* would arm"
    assert re.search(said, applied.what)


def test_a_level_that_belongs_to_earlier_offsets_is_kept_by_them():
    vehicle, _, link = vehicle_of("ardupilot", ",imus=1")
    first = float(vehicle.firmware.store["INS_ACCOFFS_X"])
    assert send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, 2) == 0
    # another station changes an offset while the vehicle is measured, or before
    vehicle.firmware.store["INS_ACCOFFS_X"] = first + 0.5
    during, before = calibration_of(vehicle), calibration_of(vehicle)
    during.extra["autopilot"]["params_first"] = {"INS_ACCOFFS_X": first}
    known, unknown = copy.deepcopy((vehicle, link)), (vehicle, link)
    for (at, to), calibration, is_level in ((known, during, True), (unknown, before, False)):
        said = AutopilotSink(to, confirm=yes).write(calibration).what
        assert (np.abs(attitude_deg(at, to)).max() < 0.2) == is_level
        assert ("it shows level as it stands" in said) is is_level
        assert ("if it stands as it should hover" in said) is not is_level
        assert "is level within" not in said


def test_a_vehicle_is_level_as_it_stands_if_the_person_confirms_it():
    vehicle, _, link = vehicle_of("px4", ",imus=1" + LEVELLED["px4"])
    applied = AutopilotSink(link, confirm=lambda question, with_yes: True).write(calibration_of(vehicle))
    assert np.abs(attitude_deg(vehicle, link)).max() < 0.1
    assert re.search(r"it is level as it stands now .* horizon is level within 0\.0\d deg", applied.what)
    truth = vehicle.truth_document()
    np.testing.assert_allclose(applied.calibration.D, truth["D"], atol=1e-6)
    np.testing.assert_allclose(applied.calibration.b_a, truth["b_a"], atol=1e-6)


def test_an_unchecked_horizon_after_a_reboot_asks_for_no_second_reboot(monkeypatch):
    def silent(*_):
        raise LinkError("it is silent", "look")

    monkeypatch.setattr(Horizon, "settled", silent)
    vehicle, _, link = vehicle_of("ardupilot", ",imus=1")
    applied = AutopilotSink(link, confirm=lambda question, with_yes: with_yes).write(calibration_of(vehicle))
    assert "it is silent: look, and look whether its horizon is level before it flies" in applied.what


def test_an_unset_level_is_not_derived_and_a_reboot_only_on_request():
    vehicle, _, link = vehicle_of("ardupilot", ",imus=1")
    applied = AutopilotSink(link).write(calibration_of(vehicle))
    assert not vehicle.firmware.trim_deg.any()
    assert "its level was never set" in applied.what
    assert "reboot it before it flies" in applied.what
    assert "would arm" not in applied.what


def test_saved_parameters_are_restored(tmp_path):
    vehicle, _, link = vehicle_of("ardupilot", ",imus=1" + LEVELLED["ardupilot"])
    sink = AutopilotSink(link)
    old = stored(vehicle)
    (kept,) = sink.keep(tmp_path)
    sink.write(calibration_of(vehicle))
    (later,) = sink.keep(tmp_path)
    assert stored(vehicle) != old
    assert later != kept
    assert "reboot it" in sink.put_back(kept)
    assert stored(vehicle) == old


def unchanged(calibration):
    return calibration


def refused(calibration):
    return replace(calibration, quality=MappingProxyType(REFUSED))


def of_a_chip(calibration):
    return replace(calibration, extra=MappingProxyType({}))


def beyond_limits(calibration):
    new = calibration.extra["autopilot"]["params_new"]
    new[next(name for name in new if "SCAL" in name)] = 7.5
    return calibration


def of_another_sensor(calibration):
    old = calibration.extra["autopilot"]["params_old"]
    old[next(name for name in old if name.endswith("_ID") and old[name] > 1000)] += 8
    return calibration


def of_px4(calibration):
    return calibration_of(vehicle_of("px4", ",imus=1")[0])


@pytest.mark.parametrize(
    ("firmware", "words", "change", "why"),
    [
        ("ardupilot", ",imus=1", refused, "refused"),
        ("ardupilot", ",imus=1", of_a_chip, "of no vehicle"),
        ("px4", ",imus=1", beyond_limits, "beyond"),
        ("ardupilot", ",imus=1", of_another_sensor, "of sensor"),
        ("ardupilot", ",imus=1", of_px4, "PX4"),
        ("ardupilot", ",fault=arm@3", unchanged, "armed"),
        ("ardupilot", ",imus=1,hand=restless", unchanged, "still"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_an_unfit_calibration_is_not_written(firmware, words, change, why):
    vehicle, transport, link = vehicle_of(firmware, words)
    with pytest.raises(WriteBackError, match=rf"nothing was written.*{why}"):
        AutopilotSink(link).write(change(calibration_of(vehicle)))
    assert transport.sets == 0


def test_sensors_without_ids_of_their_own_are_given_theirs_and_a_refused_fit_changes_nothing():
    vehicle, _, link = vehicle_of("ardupilot", ",INS_ACC_ID=0,INS_ACC2_ID=4711")
    assert vehicle.firmware.complaints() == ["PreArm: 3D Accel calibration needed"]
    calibration = calibration_of(vehicle)
    calibration.extra["others"][0]["quality"] = REFUSED
    old = stored(vehicle)
    applied = AutopilotSink(link).write(calibration)
    assert vehicle.firmware.complaints() == []
    assert [name for name, value in stored(vehicle).items() if value != old[name] and "ACC2" in name] == []
    assert "IMU 2 keeps" in applied.what
    said = summary(calibration).splitlines()
    assert ("The calibration is good." in said, "The calibration of IMU 2 is refused:" in said) == (True, True)
    assert sum(line.startswith("IMU 1, value") for line in said) == 1


def test_px4_uses_what_it_stores_though_the_change_is_small():
    # 0.004 m/s^2 from what is in use: PX4 would store it and go on as before
    vehicle, _, link = vehicle_of("px4", ",imus=1")
    calibration = calibration_of(vehicle)
    sink = AutopilotSink(link)
    applied = sink.write(calibration)
    new = applied.calibration.extra["autopilot"]["params_new"]
    new["CAL_ACC0_XOFF"] += 0.004
    sink.write(applied.calibration)
    offset, _ = vehicle.firmware.correction(0)
    assert offset[0] == pytest.approx(new["CAL_ACC0_XOFF"], abs=1e-6)
    vehicle.firmware.start()
    np.testing.assert_allclose(vehicle.firmware.correction(0)[0], offset)


def at_set(transport, number, fault):
    """Call `fault` with the nth PARAM_SET, before the vehicle has it."""

    def on_set(count, message):
        if count == number:
            fault(message)
        return True

    transport.on_set = on_set


def lose(transport, number):
    """Lose the nth PARAM_SET and five more."""
    transport.on_set = lambda count, message: not number <= count < number + 6


def arm(transport, number):
    """Arm the vehicle at the nth PARAM_SET."""
    at_set(transport, number, lambda message: setattr(transport.vehicle.firmware, "armed", True))


def refuse(transport, number):
    """Refuse the next new parameter from the nth PARAM_SET on."""
    seen, names = set(), []

    def on_set(count, message):
        if count >= number and not names and message.param_id not in seen:
            names.append(message.param_id)
        seen.add(message.param_id)
        return message.param_id not in names

    transport.on_set = on_set


def spoil(transport, number):
    """Write another value from elsewhere just before the nth PARAM_SET."""

    def change_other(message):
        store = transport.vehicle.firmware.store
        other = next(name for name in stored(transport.vehicle) if name[:8] == message.param_id[:8])
        store[other] = float(store[other]) + 0.3

    at_set(transport, number, change_other)


def vanish(transport, number):
    """Silence the vehicle for good at the nth PARAM_SET."""
    at_set(transport, number, lambda message: transport.vehicle.fall_silent())


def reboot(transport, number):
    """Reboot the vehicle at the nth PARAM_SET."""
    at_set(transport, number, lambda message: transport.vehicle.reboot())


@settings(max_examples=10)
@given(
    firmware=st.sampled_from(FIRMWARES),
    fault=st.sampled_from([lose, arm, refuse, spoil, reboot, vanish]),
    number=st.integers(1, 18),
)
def test_a_fault_at_any_step_leaves_the_old_or_the_new_parameters(firmware, fault, number):
    vehicle, transport, link = vehicle_of(firmware, ",imus=1" + LEVELLED[firmware])
    calibration = calibration_of(vehicle)
    old = stored(vehicle)
    new = {name: np.float32(value) for name, value in calibration.extra["autopilot"]["params_new"].items()}
    fault(transport, number)
    try:
        AutopilotSink(link).write(calibration)
    except WriteBackError as error:
        assert error.exit_code == 6
        assert ("could not be put back" if fault is vanish else "the old parameters are back") in error.what
        assert stored(vehicle) == old or fault is vanish
    else:
        held = stored(vehicle)
        assert {name: held[name] for name in new} == new


def test_px4s_slots_in_another_order_are_found_by_their_effect():
    ids = ",CAL_ACC0_ID=1310996,CAL_ACC1_ID=1310988"
    vehicle, _, link = vehicle_of("px4", ids + ",CAL_ACC0_XOFF=0.3,CAL_ACC1_ZSCALE=1.05")
    calibration = calibration_of(vehicle)
    applied = AutopilotSink(link).write(calibration)
    for imu in range(2):
        offset, scale = vehicle.firmware.correction(imu)
        np.testing.assert_allclose(offset, vehicle.imus.truths[imu].b_a, atol=1e-6)
        np.testing.assert_allclose(scale, np.diag(np.linalg.inv(vehicle.imus.truths[imu].D)), atol=1e-6)
    truth = vehicle.truth_document()
    np.testing.assert_allclose(applied.calibration.D, truth["D"], atol=1e-6)
    assert "CAL_ACC1_XOFF" in applied.calibration.extra["autopilot"]["params_new"]


def test_an_imu_that_would_not_become_better_keeps_its_parameters():
    vehicle, _, link = vehicle_of("px4")
    sink = AutopilotSink(link)
    once = sink.write(calibration_of(vehicle)).calibration
    vehicle.firmware.store[next(name for name in stored(vehicle) if "ACC" in name and "2" not in name)] = 0.3
    vehicle.firmware.start()
    again = calibration_of(vehicle)
    assert sink.reason_to_keep(again) is None
    old = stored(vehicle)
    applied = sink.write(again)
    changed = {name for name, value in stored(vehicle).items() if value != old[name]}
    assert changed
    assert not any("ACC1" in name for name in changed)
    assert "IMU 2 keeps its old ones, which are predicted to be as good" in applied.what
    # a vehicle that is already calibrated is written to only if a person confirms it
    assert "as good as the new ones" in sink.reason_to_keep(once)


def test_parameters_within_the_dead_band_of_px4_are_reported_as_kept():
    vehicle, _, link = vehicle_of("px4")
    vehicle.imus.truths = (vehicle.imus.truths[0], vehicle.imus.truths[1]._replace(D=np.eye(3), b_a=np.full(3, 0.004)))
    calibration = calibration_of(vehicle)
    applied = AutopilotSink(link).write(calibration)
    assert "has the new parameters of IMU 1, read back" in applied.what
    assert "IMU 2 keeps" in applied.what


class Killed(BaseException):
    """End of the program as by kill -9."""


def kill(message):
    raise Killed


@pytest.mark.parametrize(("firmware", "name"), [("px4", "SIGTERM"), ("ardupilot", "SIGINT")])
@pytest.mark.usefixtures("uncollected")
def test_a_signal_in_the_middle_of_a_write_restores(firmware, name, tmp_path):
    vehicle, transport, link = vehicle_of(firmware, ",imus=1")
    old, numbers = stored(vehicle), []

    def on_set(count, message):
        numbers.append(count)
        # the second one comes while the old parameters are put back
        if (count in (4, 6) and name != "SIGINT") or count == 4:
            os.kill(os.getpid(), getattr(signal, name))
        return True

    transport.on_set = on_set
    journal = Journal(tmp_path / "note.json")
    sink = AutopilotSink(link, journal=journal)
    before = signal.getsignal(getattr(signal, name))
    with pytest.raises(WriteBackError, match="interrupted; the old parameters are back") as raised:
        write_to(SINKS["autopilot"], sink, calibration_of(vehicle), tmp_path, lambda kind, now: now, print)
    assert raised.value.exit_code == 6
    assert len(numbers) > 6
    assert stored(vehicle) == old
    assert journal.interrupted() is None
    assert signal.getsignal(getattr(signal, name)) == before


@pytest.mark.parametrize("number", [1, 3, 5, 6])
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_next_write_after_a_kill_restores_the_old_parameters(firmware, number, tmp_path):
    vehicle, transport, link = vehicle_of(firmware, ",imus=1")
    old, journal = stored(vehicle), Journal(tmp_path / "note.json")
    calibration = calibration_of(vehicle)
    at_set(transport, number, kill)
    with pytest.raises(Killed):
        AutopilotSink(link, journal=journal).write(calibration)
    assert journal.interrupted() is not None
    transport.on_set = lambda count, message: True
    assert (stored(vehicle) == old) is (number == 1)
    said = AutopilotSink(link, journal=journal).recover()
    assert stored(vehicle) == old
    assert journal.interrupted() is None
    assert said is None if number == 1 else "the old parameters are restored" in said
    assert AutopilotSink(link, journal=journal).recover() is None


def test_parameters_of_an_interrupted_write_are_not_restored_to_another_vehicle(tmp_path):
    vehicle, transport, link = vehicle_of("ardupilot", ",imus=1")
    journal = Journal(tmp_path / "note.json")
    at_set(transport, 3, kill)
    with pytest.raises(Killed):
        AutopilotSink(link, journal=journal).write(calibration_of(vehicle))
    other, sets, link = vehicle_of("ardupilot", ",imus=1,seed=9,INS_ACCOFFS_X=0.7")
    assert "not changed" in AutopilotSink(link, journal=journal).recover()
    assert sets.sets == 0
    assert other.firmware.store["INS_ACCOFFS_X"] == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("kind", "attacker"),
    [
        ("mixed", "a stranger"),
        ("mixed", "against signing"),
        ("parameters", "the address forged"),
        ("values", "the address forged"),
    ],
)
def test_an_attacked_write_sets_no_other_parameter(kind, attacker, monkeypatch):
    key = hostile.KEY if attacker == hostile.SIGNED else None
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:imus=1"), key=key)
    attack = hostile.Attack(kind, attacker, "ardupilot", 0, 40.0)
    attack.draw("write")
    monkeypatch.setattr(hostile.HostileTransport, "attack", attack, raising=False)
    link = Link(hostile.HostileTransport(vehicle), lambda t_ns, data: None, key)
    link.lock(link.listen()[0])
    link.send(encode_prompt(ReceivedPrompt("lay_flat", None)))
    list(link.messages(link.now_ns() + 4_000_000_000))
    calibration = calibration_of(vehicle)
    new, old = calibration.extra["autopilot"]["params_new"], stored(vehicle)
    try:
        AutopilotSink(link).write(calibration)
    except WriteBackError:
        assert attacker == hostile.FORGED
        assert stored(vehicle) == old
    else:
        assert {name: stored(vehicle)[name] for name in new} == pytest.approx(new)
    assert attack.sent > 100
    for name, value, before in attack.sets:
        assert value in (before, pytest.approx(new[name]))


def test_an_impostor_of_the_vehicle_is_detected_by_its_answers():
    vehicle, transport, link = vehicle_of("ardupilot", ",imus=1")
    impostor = dialect().MAVLink(None, 1, 1)
    send = transport.send

    def also_answered(data, address):
        answer = impostor.param_value_encode(b"INS_ACCOFFS_Y", 0.3, 9, 9, 1)
        transport._queue.append(ReceivedBytes(bytes(answer.pack(impostor)), ADDRESS, link.now_ns()))
        impostor.seq = (impostor.seq + 1) % 256
        send(data, address)

    transport.send = also_answered
    with pytest.raises(WriteBackError, match=r"nothing was written.*INS_ACCOFFS_Y = 0.001 and 0.3"):
        AutopilotSink(link).write(calibration_of(vehicle))
    assert transport.sets == 0
