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

RNG = np.random.default_rng(6)
TRUE_OFFSET = np.array([0.31, -0.22, 0.58])
GAIN = np.array([1.021, 0.987, 1.034])
OLD = {"offset": np.array([0.05, 0.02, -0.3]), "scale": np.array([0.99, 1.01, 1.0])}
# MAV_SENSOR_ORIENTATION 0, 2 (yaw 90) and 8 (roll 180), as MAVLink's table has them
MOUNTINGS = {
    0: np.eye(3),
    2: np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    8: np.diag([1.0, -1.0, -1.0]),
}
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


def delivered(s, offset, scale, R_b):
    """Return the stream (n, 3) of a firmware from its sensor's output, in the order of AP_InertialSensor and PX4."""
    return ((s - offset) * scale) @ R_b.T


def parsed(text):
    """NAME -> value of a .param or .params file, by its ground station's rules."""
    rows = [re.split(r"[\t,]", line) for line in text.splitlines() if line and not line.startswith("#")]
    return {row[-3] if len(row) == 5 else row[0]: float(row[-2] if len(row) == 5 else row[1]) for row in rows}


def of_vehicle(name, rotation, A):
    """Return the calibration of a perfect fit of the stream under OLD."""
    R_b, (offsets, scales, orientation) = MOUNTINGS[rotation], NAMES[name]
    parameters = {
        **IDS[name],
        **dict(zip(offsets, OLD["offset"], strict=True)),
        **dict(zip(scales, OLD["scale"], strict=True)),
        orientation: float(rotation),
        **({"SENS_BOARD_X_OFF": 0.0, "SENS_BOARD_Y_OFF": 0.0, "SENS_BOARD_Z_OFF": 0.0} if name == "px4" else {}),
    }
    K = np.diag(OLD["scale"])
    made = Calibration(
        R_b @ K @ A @ R_b.T,
        R_b @ K @ (TRUE_OFFSET - OLD["offset"]),
        fit={"gravity": 9.80665},
        quality={"verdict": "good", "reasons": []},
    )
    firmware = "PX4" if name == "px4" else "ArduPilot"
    document = autopilot_document(Autopilot(firmware, 1, "RAW_IMU", parameters), made)
    return replace(made, extra=MappingProxyType({"autopilot": document}))


@pytest.mark.parametrize("rotation", MOUNTINGS)
@pytest.mark.parametrize("name", NAMES)
def test_the_file_does_what_apply_does(name, rotation):
    calibration = of_vehicle(name, rotation, np.diag(GAIN))
    new = parsed(form(name).export(calibration)[0])
    offsets, scales, _ = NAMES[name]
    f = RNG.uniform(-20.0, 20.0, (300, 3))
    s = f @ MOUNTINGS[rotation] @ np.diag(GAIN) + TRUE_OFFSET
    y = delivered(s, OLD["offset"], OLD["scale"], MOUNTINGS[rotation])
    loaded = delivered(s, [new[n] for n in offsets], [new[n] for n in scales], MOUNTINGS[rotation])
    # float32 of the parameters, at 20 m/s^2
    np.testing.assert_allclose(loaded, calibration.apply(y), atol=2e-5)
    np.testing.assert_allclose(loaded, f, atol=2e-5)


@pytest.mark.parametrize("rotation", MOUNTINGS)
@pytest.mark.parametrize("name", NAMES)
def test_what_is_left_is_what_it_says(name, rotation):
    A = np.diag(GAIN) + np.array([[0.0, 0.013, -0.007], [-0.009, 0.0, 0.021], [0.004, -0.016, 0.0]])
    calibration = of_vehicle(name, rotation, A)
    text, notes = form(name).export(calibration)
    new = parsed(text)
    offsets, scales, _ = NAMES[name]
    points = RNG.normal(size=(4000, 3))
    f = 9.80665 * points / np.linalg.norm(points, axis=1, keepdims=True)
    s = f @ MOUNTINGS[rotation] @ A.T + TRUE_OFFSET
    loaded = delivered(s, [new[n] for n in offsets], [new[n] for n in scales], MOUNTINGS[rotation])
    worst = np.abs(np.linalg.norm(loaded, axis=1) - 9.80665).max()
    assert worst == pytest.approx(float(re.search(r"up to (\S+) m/s", notes[0])[1]), rel=0.02, abs=1e-3)


def test_mavproxy_loads_it_with_the_sensors_id(tmp_path):
    """Load the file by MAVProxy's reader, pymavlink; without its id an accelerometer is uncalibrated."""
    calibration = of_vehicle("ardupilot", 0, np.diag(GAIN))
    (tmp_path / "new.param").write_text(form("ardupilot").export(calibration)[0])
    loaded = MAVParmDict()
    loaded.load(str(tmp_path / "new.param"), check=False)
    assert loaded["INS_ACC_ID"] == IDS["ardupilot"]["INS_ACC_ID"]
    assert set(loaded) == {"INS_ACC_ID", *NAMES["ardupilot"][0], *NAMES["ardupilot"][1]}


def test_qgroundcontrol_loads_it_with_the_sensors_id():
    """Expect five columns, and the type of each parameter, without which QGroundControl ignores it (INT32 is 6)."""
    lines = form("px4").export(of_vehicle("px4", 0, np.diag(GAIN)))[0].splitlines()
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    assert all(len(row) == 5 for row in rows)
    kinds = {row[2]: row[4] for row in rows}
    assert kinds == {"CAL_ACC0_ID": "6", **dict.fromkeys([*NAMES["px4"][0], *NAMES["px4"][1]], "9")}
    assert ["1", "1", "CAL_ACC0_ID", "1310988", "6"] in rows


@pytest.mark.parametrize("name", NAMES)
def test_an_id_that_the_vehicle_did_not_say_is_missed(name):
    calibration = of_vehicle(name, 0, np.diag(GAIN))
    document = calibration.extra["autopilot"]
    of = next(key for key in IDS[name] if key.endswith("_ID"))
    old = {key: value for key, value in document["params_old"].items() if key != of}
    calibration = replace(calibration, extra={"autopilot": document | {"params_old": old}})
    text, notes = form(name).export(calibration)
    assert of not in parsed(text)
    assert f"did not report {of}" in " ".join(notes)


@pytest.mark.parametrize("key", ["mounting", "params_old", "imu", "firmware", "message", "residual_mps2"])
def test_a_document_that_no_session_wrote_is_refused(key):
    made = of_vehicle("ardupilot", 0, np.diag(GAIN))
    lacking = {name: value for name, value in made.extra["autopilot"].items() if name != key}
    with pytest.raises(WriteBackError, match=f"has no {key} of the vehicle"):
        form("ardupilot").export(replace(made, extra=MappingProxyType({"autopilot": lacking})))


@pytest.mark.parametrize(
    ("name", "gain", "says"),
    [("px4", GAIN, "PX4"), ("ardupilot", [0.5, 1.0, 1.0], "beyond")],
    ids=["another firmware", "beyond ArduPilot's own limits"],
)
def test_what_ardupilot_does_not_take_is_refused(name, gain, says):
    with pytest.raises(WriteBackError, match=says):
        form("ardupilot").export(of_vehicle(name, 0, np.diag(gain)))
