"""A recorded session with PX4 1.18-dev: its board turned and tilted, one sensor outside with a turn of its own.

SENS_BOARD_ROT 4 (yaw 180), SENS_BOARD_X_OFF 2, SENS_BOARD_Z_OFF -1, CAL_ACC2_ROT 2 (yaw 90), CAL_ACC2_XOFF 0.2. A
simulated hand fed its HIL_SENSOR; of each stream every fifth sample was kept.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from mpucal.cli import commands
from mpucal.mavlink.parameters.document import NEW
from mpucal.mavlink.parameters.slots import find_slot

RECORDED = Path(__file__).parent / "data" / "px4_turned.tlog"
# of each IMU: offset [m/s^2] and scale that are right, by what fed the sensors
TRUE = {
    1: ((-0.5851, -0.38097, -0.70241), (1.006396, 1.030025, 1.005061)),
    3: ((0.30931, 0.54022, 0.52723), (1.028497, 0.98194, 1.010728)),
}


@pytest.fixture(scope="module")
def documents():
    result = CliRunner().invoke(commands, ["calibrate", str(RECORDED), "--json"])
    first = json.loads(result.stdout)
    return {one["autopilot"]["imu"]: one["autopilot"] for one in (first, *first["others"])}


@pytest.mark.parametrize("imu", [1, 3])
def test_parameters_are_right_in_each_sensors_own_axes(documents, imu):
    new = documents[imu][NEW]
    found = find_slot("PX4", imu, documents[imu]["params_old"]).correction(new)
    offset, scale = TRUE[imu]
    assert found.offset == pytest.approx(np.array(offset), abs=4e-3)
    assert found.scale == pytest.approx(np.array(scale), abs=2e-3)


def test_the_sensor_outside_turns_with_its_own_rotation(documents):
    inside, outside = (np.array(documents[imu]["mounting"]) for imu in (1, 3))
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    # yaw 180 and back, yaw 90
    assert inside.T @ outside == pytest.approx(turn, abs=1e-9)
