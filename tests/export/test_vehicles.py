"""Parameter files loaded the way the firmwares use them, in their order: offset, scale, then the board's rotation."""

import re
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from pymavlink.mavparm import MAVParmDict

from mpucal.data import Autopilot
from mpucal.errors import WriteBackError
from mpucal.export.forms import form
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.result.calibration import Calibration

TRUE_OFFSET = np.array([0.31, -0.22, 0.58])
GAIN = np.array([1.021, 0.987, 1.034])
OLD = {"offset": np.array([0.05, 0.02, -0.3]), "scale": np.array([0.99, 1.01, 1.0])}
# MAV_SENSOR_ORIENTATION 2 (yaw 90), as MAVLink's table has it; tests/mavlink has all others
ROTATION, R_B = 2, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
NAMES = {
    "ardupilot": (
        [f"INS_ACCOFFS_{axis}" for axis in "XYZ"],
        [f"INS_ACCSCAL_{axis}" for axis in "XYZ"],
        "AHRS_ORIENTATION",
    ),
    "px4": ([f"CAL_ACC0_{axis}OFF" for axis in "XYZ"], [f"CAL_ACC0_{axis}SCALE" for axis in "XYZ"], "SENS_BOARD_ROT"),
}
IDS = {
    "ardupilot": {"INS_ACC_ID": 1245.0},
    "px4": {"CAL_ACC0_ID": 1310988.0, "CAL_ACC0_ROT": -1.0, "CAL_ACC0_PRIO": 50.0},
}


def delivered(s, offset, scale):
    """Return the stream (n, 3) of a firmware from its sensor's output, in the order of AP_InertialSensor and PX4."""
    return ((s - offset) * scale) @ R_B.T


def loaded(folder, name, text):
    """Return NAME -> value: by MAVProxy's reader, pymavlink, or in QGroundControl's five columns.

    QGroundControl ignores a parameter without its type: INT32 is 6, REAL32 9.
    """
    if name == "px4":
        rows = [line.split("\t") for line in text.splitlines() if not line.startswith("#")]
        assert {(*row[:2], row[4]) for row in rows} == {("1", "1", "6"), ("1", "1", "9")}
        assert [row[2] for row in rows if row[4] == "6"] == ["CAL_ACC0_ID"]
        return {row[2]: float(row[3]) for row in rows}
    (folder / "new.param").write_text(text)
    parameters = MAVParmDict()
    parameters.load(str(folder / "new.param"), check=False)
    return dict(parameters)


def of_vehicle(name, A):
    """Return the calibration of a perfect fit of the stream under OLD."""
    offsets, scales, orientation = NAMES[name]
    parameters = {
        **IDS[name],
        **dict(zip(offsets, OLD["offset"], strict=True)),
        **dict(zip(scales, OLD["scale"], strict=True)),
        orientation: float(ROTATION),
        **({"SENS_BOARD_X_OFF": 0.0, "SENS_BOARD_Y_OFF": 0.0, "SENS_BOARD_Z_OFF": 0.0} if name == "px4" else {}),
    }
    K = np.diag(OLD["scale"])
    made = Calibration(
        R_B @ K @ A @ R_B.T,
        R_B @ K @ (TRUE_OFFSET - OLD["offset"]),
        fit={"gravity": 9.80665},
        quality={"verdict": "good", "reasons": []},
    )
    firmware = "PX4" if name == "px4" else "ArduPilot"
    document = autopilot_document(Autopilot(firmware, 1, "RAW_IMU", parameters), made)
    return replace(made, extra=MappingProxyType({"autopilot": document}))


@pytest.mark.parametrize("name", NAMES)
def test_the_file_does_what_apply_does_and_says_what_is_left(name, tmp_path):
    offsets, scales, _ = NAMES[name]
    of = next(key for key in IDS[name] if key.endswith("_ID"))
    cross = np.array([[0.0, 0.013, -0.007], [-0.009, 0.0, 0.021], [0.004, -0.016, 0.0]])
    points = np.random.default_rng(6).normal(size=(4000, 3))
    f = 9.80665 * points / np.linalg.norm(points, axis=1, keepdims=True)
    for A in (np.diag(GAIN), np.diag(GAIN) + cross):
        calibration = of_vehicle(name, A)
        text, notes = form(name).export(calibration)
        new = loaded(tmp_path, name, text)
        # without its id an accelerometer is uncalibrated
        assert new.keys() == {of, *offsets, *scales}
        assert new[of] == IDS[name][of]
        s = f @ R_B @ A.T + TRUE_OFFSET
        a = delivered(s, [new[n] for n in offsets], [new[n] for n in scales])
        if not (A - np.diag(GAIN)).any():
            # float32 of the parameters
            np.testing.assert_allclose(a, f, atol=2e-5)
            np.testing.assert_allclose(a, calibration.apply(delivered(s, OLD["offset"], OLD["scale"])), atol=2e-5)
        else:
            worst = np.abs(np.linalg.norm(a, axis=1) - 9.80665).max()
            assert worst == pytest.approx(float(re.search(r"up to (\S+) m/s", notes[0])[1]), rel=0.02)


@pytest.mark.parametrize("name", NAMES)
def test_an_id_that_the_vehicle_did_not_say_is_missed(name):
    calibration = of_vehicle(name, np.diag(GAIN))
    document = calibration.extra["autopilot"]
    of = next(key for key in IDS[name] if key.endswith("_ID"))
    old = {key: value for key, value in document["params_old"].items() if key != of}
    calibration = replace(calibration, extra={"autopilot": document | {"params_old": old}})
    text, notes = form(name).export(calibration)
    assert not [line for line in text.splitlines() if of in line and not line.startswith("#")]
    assert f"did not report {of}" in " ".join(notes)


def test_the_calibration_of_a_dataflash_log_is_exported_too():
    made = of_vehicle("ardupilot", np.diag(GAIN))
    logged = replace(made, extra={"autopilot": made.extra["autopilot"] | {"message": "IMU"}})
    assert form("ardupilot").export(logged) == form("ardupilot").export(made)


@pytest.mark.parametrize("key", ["mounting", "params_old"])
def test_a_document_that_no_session_wrote_is_refused(key):
    made = of_vehicle("ardupilot", np.diag(GAIN))
    lacking = {name: value for name, value in made.extra["autopilot"].items() if name != key}
    with pytest.raises(WriteBackError, match=f"not one that a session writes.*{key}"):
        form("ardupilot").export(replace(made, extra=MappingProxyType({"autopilot": lacking})))


@pytest.mark.parametrize(
    ("name", "gain", "says"),
    [("px4", GAIN, "PX4"), ("ardupilot", [0.5, 1.0, 1.0], "beyond")],
    ids=["another firmware", "beyond ArduPilot's own limits"],
)
def test_gains_that_ardupilot_does_not_take_are_refused(name, gain, says):
    with pytest.raises(WriteBackError, match=says):
        form("ardupilot").export(of_vehicle(name, np.diag(gain)))
