"""Whether a vehicle would arm, and what it says where it would not."""

import pytest

from mpucal.mavlink.link import Link
from mpucal.mavlink.prearm import check_prearm
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport


def px4(words=""):
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:firmware=px4{words}"))
    link = Link(SimulatedTransport(vehicle), lambda t_ns, packet: None)
    link.lock(link.listen()[0])
    return vehicle, link


@pytest.mark.parametrize("words", ["", ",CAL_ACC0_ID=0"], ids=["ready", "a sensor without a slot"])
def test_px4_says_whether_it_would_arm_though_it_does_not_list_the_check(words):
    vehicle, link = px4(words)
    assert not vehicle.firmware.sys_status().onboard_control_sensors_present & 0x10000000
    assert check_prearm(link).ready is not bool(words)


def test_px4_that_tells_why_by_events_alone_is_said_to(monkeypatch):
    vehicle, link = px4()
    monkeypatch.setattr(vehicle.firmware, "complaints", lambda: ["in an event"])
    assert str(check_prearm(link)) == "would not arm: its events say why, as QGroundControl shows them"
