"""Samples to which a calibration must not be applied; tests of `mpucal apply` prove the correct application."""

from types import MappingProxyType

import numpy as np
import pytest

from mpucal.data import Autopilot, Sensor
from mpucal.errors import UsageError
from mpucal.result.calibration import Calibration
from mpucal.result.correction import make_correction

OLD, NEW = {"INS_ACCOFFS_X": 0.0}, {"INS_ACCOFFS_X": 0.3}
CHIP, STREAM = Sensor(who_am_i=0x68), Sensor(chip="ArduPilot-IMU1", message="RAW_IMU")
VEHICLE = MappingProxyType({"autopilot": {"params_old": OLD, "params_new": NEW}})


def made(sensor=Sensor(), extra=MappingProxyType({})):  # noqa: B008 - both are frozen
    return Calibration(np.eye(3), np.zeros(3), quality={"verdict": "good", "reasons": []}, sensor=sensor, extra=extra)


def through(parameters):
    return Autopilot("ArduPilot", 1, "RAW_IMU", parameters)


@pytest.mark.parametrize(
    ("calibration", "sensor", "autopilot", "says"),
    [
        (made(CHIP), STREAM, None, "a chip's own samples, but these are an autopilot's stream"),
        (made(STREAM), CHIP, None, "an autopilot's stream, but these are a chip's own samples"),
        (made(extra=VEHICLE), Sensor(), through(NEW), "INS_ACCOFFS_X was 0.3 while .* but 0 during the calibration"),
    ],
    ids=["a chip's to a vehicle", "a vehicle's to a chip", "other parameters"],
)
def test_a_calibration_of_another_sensor_is_refused(calibration, sensor, autopilot, says):
    with pytest.raises(UsageError, match=says):
        make_correction(calibration, sensor, autopilot)


@pytest.mark.parametrize("calibration", [made(), made(extra=VEHICLE)], ids=["of anything", "of the vehicle"])
def test_a_sensor_of_unknown_identity_is_accepted(calibration):
    assert make_correction(calibration, Sensor(), through(OLD)).calibration is calibration
