"""A vehicle's new parameters as files."""

from types import MappingProxyType

import numpy as np
import pytest

from mpucal.data import Autopilot
from mpucal.errors import WriteBackError
from mpucal.export.forms import form
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.mavlink.parameters.text import read_parameters_file
from mpucal.result.calibration import Calibration

D = np.array([[1.02, 0.01, 0.0], [0.0, 0.98, 0.0], [0.0, -0.01, 1.01]])
B_A = np.array([0.3, -0.2, 0.1])
ARDUPILOT = {"AHRS_ORIENTATION": 0.0} | {
    f"INS_ACC{kind}_{axis}": value for kind, value in (("OFFS", 0.0), ("SCAL", 1.0)) for axis in "XYZ"
}
PX4 = {"SENS_BOARD_ROT": 0.0, "CAL_ACC1_ID": 1310988.0} | {
    f"CAL_ACC1_{axis}{kind}": value for kind, value in (("OFF", 0.0), ("SCALE", 1.0)) for axis in "XYZ"
}


def calibration(firmware, parameters, D=D, verdict="good"):
    fitted = Calibration(D, B_A, fit={"gravity": 9.80665}, quality={"verdict": verdict, "reasons": []})
    document = autopilot_document(Autopilot(firmware, 1, "SCALED_IMU", parameters), fitted)
    return Calibration(D, B_A, fit=fitted.fit, quality=fitted.quality, extra=MappingProxyType({"autopilot": document}))


@pytest.mark.parametrize(
    ("name", "firmware", "parameters", "first"),
    [("ardupilot", "ArduPilot", ARDUPILOT, "INS_ACCOFFS_X"), ("px4", "PX4", PX4, "CAL_ACC1_XOFF")],
    ids=["ardupilot", "px4"],
)
def test_the_file_holds_the_new_parameters(tmp_path, name, firmware, parameters, first):
    made = calibration(firmware, parameters)
    text, notes = form(name).export(made)
    file = tmp_path / f"new{form(name).suffix}"
    file.write_text(text)
    held = read_parameters_file(file)
    # the sensors' IDs stand beside them
    assert [key for key in held if not key.endswith("_ID")] == list(made.extra["autopilot"]["params_new"])
    assert held[first] == np.float32(B_A[0])
    assert f"{made.extra['autopilot']['residual_mps2']:.3f} m/s^2" in notes[0]


def test_the_other_firmwares_calibration_is_refused():
    with pytest.raises(WriteBackError, match="PX4"):
        form("ardupilot").export(calibration("PX4", PX4))


def test_a_scale_beyond_ardupilots_own_limits_is_refused():
    with pytest.raises(WriteBackError, match="beyond"):
        form("ardupilot").export(calibration("ArduPilot", ARDUPILOT, D=np.diag([0.5, 1.0, 1.0])))
