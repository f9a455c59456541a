"""Examination of the simulated vehicle, with faults that endanger a flight."""

import pytest

from mpucal.chip.config import RateOnlyConfig
from mpucal.doctor.finding import Mark
from mpucal.session.plan import Plan
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import SimulatedTransport
from mpucal.vehicle.doctor import examine_vehicle
from mpucal.vehicle.source import OpenedVehicle


def examined(words):
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:seed=3,{words}"))
    before = dict(vehicle.firmware.store.items())
    source = OpenedVehicle(SimulatedTransport(vehicle), Plan(config=RateOnlyConfig(rate_hz=100)))
    found = {finding.topic: finding for finding in examine_vehicle(source, 4.0)}
    assert dict(vehicle.firmware.store.items()) == before
    return found


def test_a_vehicle_without_faults_has_none_and_shows_what_a_write_would_change():
    found = examined("imus=2,AHRS_TRIM_X=0.0174532925,INS_ACCOFFS_Y=0.25")
    # Two IMUs have to agree for ten seconds before an ArduPilot would arm.
    assert {topic for topic, finding in found.items() if finding.mark is not Mark.OK} <= {"arming check"}
    assert found["firmware"].what == "ArduPilot 4.7.0-dev, commit 5117ed00"
    assert found["vehicle"].what.endswith("quadrotor")
    assert found["IMU 1"].data["message"] == "HIGHRES_IMU"
    assert found["IMU 2"].data["rate_hz"] == pytest.approx(100.0, rel=0.01)
    assert found["IMU 1, a write"].data["INS_ACCOFFS_Y"] == 0.25
    assert len([name for name in found["IMU 2, a write"].data if name.startswith("INS_ACC2")]) == 7
    assert "roll +1.00" in found["level"].what


@pytest.mark.parametrize(
    ("words", "topic", "mark", "says"),
    [
        ("imus=1,fault=arm@1", "armed", Mark.BAD, "keep clear of its propellers"),
        ("imus=1,fault=loss", "link", Mark.NOTE, "nearer or faster"),
        ("imus=1,fault=second_station@6", "other stations", Mark.NOTE, "system 255 is here"),
        ("imus=1,highres=no,fault=second_station@6", "IMU 1", Mark.NOTE, "end other ground stations"),
        ("imus=1,fault=reboot@7", "streams", Mark.BAD, "nothing came"),
        ("imus=1,hand=restless", "IMU 1, at rest", Mark.UNKNOWN, "the vehicle moved"),
        ("imus=1,INS_ACCEL_FILTER=1,highres=no,rotation=100", "IMU 1, rounding", Mark.NOTE, "raise INS_ACCEL_FILTER"),
        ("firmware=px4,imus=1,CAL_ACC0_ID=0", "IMU 1, a write", Mark.BAD, "--prepare"),
        ("imus=1,MAV_OPTIONS=1", "link", Mark.BAD, "--source-system"),
    ],
)
def test_a_fault_is_named(words, topic, mark, says):
    found = examined(words)[topic]
    assert (found.mark, says in f"{found.what} {found.remedy}") == (mark, True), found
