"""A vehicle's pre-arm check, and the reasons that it gives."""

import pytest

from mpucal.mavlink.prearm import check_prearm


@pytest.mark.parametrize("words", ["", ",CAL_ACC0_ID=0"], ids=["ready", "a sensor without a slot"])
def test_px4_says_whether_it_would_arm_though_it_does_not_list_the_check(simulated, words):
    px4 = simulated(f"firmware=px4{words}")
    assert not px4.vehicle.firmware.sys_status().onboard_control_sensors_present & 0x10000000
    assert check_prearm(px4.link).ready is not bool(words)


def test_px4_may_give_its_reasons_as_events_alone(simulated, monkeypatch):
    px4 = simulated("firmware=px4")
    monkeypatch.setattr(px4.vehicle.firmware, "complaints", lambda: ["in an event"])
    assert str(check_prearm(px4.link)) == "would not arm: its events say why, as QGroundControl shows them"
