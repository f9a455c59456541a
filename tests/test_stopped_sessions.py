"""A computer that stops, or is set to another day: a session goes on, with a marked gap."""

from time import time_ns
from unittest.mock import patch

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.mavlink.link import Link
from mpucal.mavlink.tlog import RawPacket
from mpucal.mavlink.transports import SteadyClock
from mpucal.mavlink.vehicle_source import VehicleSource
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport
from mpucal.sources.replay import PacketReplay
from tools.lab import campaign_worlds as worlds
from tools.processes import quick

DAY_NS = 86_400 * 10**9


def pass_by(world, seconds):
    """Pass the time while the computer does nothing; what a vehicle sends is lost."""
    transport = world.transport
    transport._vehicle.run_until(transport._vehicle.now_us + round(seconds * 1e6))


@pytest.mark.slow
def test_a_session_goes_on_where_time_passed_it_by(tmp_path, capsys):
    """Stop the session while flat, and while rotating."""
    stops_s = {5.0: 70.0, 100.0: 90.0}
    world = worlds.World(worlds.VEHICLE)
    for at_s, stopped_s in stops_s.items():
        world.at(at_s, lambda stopped_s=stopped_s: pass_by(world, stopped_s))
    days = iter(range(1, 1_000_000))
    words = ["--mavlink", "sim:imus=1", "--seed", "3", "--rate", "50", "--target", "quick", "--no-write"]
    with world.opened(), quick(), patch("time.time_ns", lambda: time_ns() + (-1) ** next(days) * DAY_NS):
        code = run(["session", *words, "-o", str(tmp_path / "board"), "--yes"])
    said = capsys.readouterr().err
    assert code == 0, said
    recording = mpucal.load(tmp_path / "board")
    steps = np.diff(recording.t)
    assert sorted(steps)[-2:] == pytest.approx([*stops_s.values()], abs=2)
    assert recording.gap[1:][steps > 0.5].all()
    for stopped_s in stops_s.values():
        assert f"Reading paused for {stopped_s:.0f} s" in said
    calibration = mpucal.Calibration.load(tmp_path / "board" / "calibration.json")
    assert (calibration.verdict, calibration.quality["reasons"], len(recording.interrupted)) == ("good", [], 2)
    assert run(["session", "--replay", str(tmp_path / "board"), "-o", str(tmp_path / "again"), "--yes"]) == 0
    replayed = mpucal.Calibration.load(tmp_path / "again" / "calibration.json")
    assert (replayed.verdict, replayed.D.tolist()) == ("good", calibration.D.tolist())
    assert said.index("Reading paused for 70 s") < said.index("TURN IT") < said.index("Reading paused for 90 s")


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "stopped_s"), [("CHIP", 5.0), ("BRIDGE", 300.0)])
def test_a_chip_is_turned_on_after_a_stop(tmp_path, capsys, kind, stopped_s):
    world = worlds.World(getattr(worlds, kind))
    world.at(30.0, lambda: world.bus._clock.spend(round(stopped_s * 1e9)))
    with world.opened(), quick():
        words = ["--bus", "sim:seed=3", "--rate", "25", "--target", "quick", "--yes"]
        code = run(["session", *words, "-o", str(tmp_path / "board")])
    said = capsys.readouterr().err
    assert code == 0, said
    assert "no samples" not in said
    recording = mpucal.load(tmp_path / "board")
    steps = np.diff(recording.t)
    assert steps.max() == pytest.approx(stopped_s, abs=1)
    assert recording.gap[1:][steps > 0.5].all()
    # as much was turned after it as before
    assert recording.t[-1] - recording.t[steps.argmax() + 1] > 20
    calibration = mpucal.Calibration.load(tmp_path / "board" / "calibration.json")
    assert calibration.quality["verification"]
    assert [reason["code"] for reason in calibration.quality["reasons"]] == ["data_lost"]


def test_the_time_of_a_link_never_follows_who_sets_the_clock():
    clock = SteadyClock()
    begun_ns = clock.now_ns()
    for jump_ns in (DAY_NS, -DAY_NS):
        with patch("time.time_ns", lambda jump_ns=jump_ns: time_ns() + jump_ns):
            assert 0 <= clock.now_ns() - begun_ns < DAY_NS // 2


def test_a_program_that_stood_still_is_told_from_a_vehicle_that_was_silent():
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:imus=1,hand=still"))
    transport, record, said = SimulatedTransport(vehicle), [], []
    link = Link(transport, lambda t_ns, data: record.append(RawPacket(t_ns, data)))
    source = VehicleSource(link, 100.0, None, said.append, "test")
    first = [source.start(), *(source.poll().t.tolist() for _ in range(20))]
    vehicle._now_us += 300_000_000
    first += [source.poll().t.tolist() for _ in range(40)]
    assert [text for text in said if "Reading paused for 300 s" in text]
    assert not [text for text in said if "has sent nothing" in text]
    recording = source.recording()
    (at,) = np.flatnonzero(recording.gap)
    (interrupted,) = recording.interrupted
    assert recording.t[at - 1] <= interrupted < recording.t[at]
    link = Link(PacketReplay(record, "capture.mcap"), lambda t_ns, data: None)
    again = VehicleSource(link, 100.0, None, lambda text: None, "test")
    assert [again.start(), *(again.poll().t.tolist() for _ in range(59))] == first[:-1]


def test_the_time_before_the_first_poll_is_the_vehicles():
    """A session that is killed as it starts has samples all the same, and its gap begins there."""
    vehicle = SimulatedVehicle(VehicleOptions.parse("sim:imus=1,hand=still"))
    source = VehicleSource(Link(SimulatedTransport(vehicle), lambda t_ns, data: None), 100.0, None, print, "test")
    source.start()
    assert 0 <= vehicle.now_us * 1e-6 - source.now_ns() * 1e-9 < 0.1
