"""An autopilot's entry in a calibration: its new parameters, or the reason why there are none."""

import numpy as np
import pytest

from mpucal.data import Autopilot
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.result.calibration import Calibration

D = np.array([[1.02, 0.01, 0.0], [0.0, 0.98, 0.0], [0.0, -0.01, 1.01]])
B_A = np.array([0.3, -0.2, 0.1])
ARDUPILOT = {"AHRS_ORIENTATION": 0.0} | {
    f"INS_ACC{kind}_{axis}": value for kind, value in (("OFFS", 0.0), ("SCAL", 1.0)) for axis in "XYZ"
}
PX4 = {"SENS_BOARD_ROT": 0.0, "CAL_ACC1_ID": 1310988.0} | {
    f"CAL_ACC1_{axis}{kind}": value for kind, value in (("OFF", 0.0), ("SCALE", 1.0)) for axis in "XYZ"
}


def document_of(firmware, parameters, D=D):
    fitted = Calibration(D, B_A, fit={"gravity": 9.80665}, quality={"verdict": "good", "reasons": []})
    return autopilot_document(Autopilot(firmware, 1, "SCALED_IMU", parameters), fitted)


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ({name: 1.0 for name in ARDUPILOT if name != "AHRS_ORIENTATION"}, "board rotation"),
        ({"AHRS_ORIENTATION": 0.0}, "INS_ACCOFFS_X"),
        (ARDUPILOT | {f"INS_ACCSCAL_{axis}": 0.0 for axis in "XYZ"}, "streams nothing"),
    ],
    ids=["rotation", "values", "zero"],
)
def test_missing_parameters_leave_no_new_ones(parameters, why):
    document = document_of("ArduPilot", parameters)
    assert document["params_new"] == {}
    assert why in document["why"]


def test_px4_gets_the_values_that_it_would_use():
    # within 0.01 of 1: PX4 would go on with 1, and the residual says what that leaves
    document = document_of("PX4", PX4, D=np.diag([1.004, 1.0, 1.0]))
    assert [document["params_new"][f"CAL_ACC1_{axis}SCALE"] for axis in "XYZ"] == [1.0, 1.0, 1.0]
    assert document["residual_mps2"] == pytest.approx(0.004 * 9.80665, rel=0.01)
