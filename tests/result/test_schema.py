"""The published schema of calibration.json, by jsonschema: every real output satisfies it, and wrong ones do not."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import mpucal
from mpucal import result
from mpucal.data import Autopilot, Sensor
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.result.calibration import Calibration
from mpucal.result.merge import merge
from mpucal.result.noise import COEFFICIENTS, Noise, with_noise

FIXTURES = Path(__file__).parents[2] / "fixtures"
SCHEMA = json.loads((Path(result.__file__).parent / "calibration.schema.json").read_text())
VALIDATOR = Draft202012Validator(SCHEMA)


@pytest.fixture(scope="module")
def document():
    return json.loads(mpucal.calibrate(FIXTURES / "sessions" / "mpu6500.mcap", "accel").json())


def unknown_keys(document, schema, path=""):
    """Return the keys of a document that its schema does not describe, by their paths."""
    if isinstance(document, list):
        return [key for item in document for key in unknown_keys(item, schema.get("items", {}), f"{path}[]")]
    if not isinstance(document, dict) or "properties" not in schema:
        return []
    known = schema["properties"]
    inner = [key for name in known.keys() & document.keys() for key in unknown_keys(document[name], known[name], name)]
    return [f"{path}.{key}" for key in document.keys() - known.keys()] + inner


def test_good_and_refused_calibrations_satisfy_the_schema(document):
    Draft202012Validator.check_schema(SCHEMA)
    VALIDATOR.validate(document)
    assert not unknown_keys(document, SCHEMA)
    recording = mpucal.load(FIXTURES / "sessions" / "mpu6500.mcap")
    refused = mpucal.calibrate(recording.part(0, 50))
    assert refused.verdict == "refused"
    document = json.loads(refused.json())
    VALIDATOR.validate(document)
    assert not unknown_keys(document, SCHEMA)


def test_the_schema_describes_the_entries_of_merges_vehicles_and_noise():
    one, other = (
        Calibration(
            np.eye(3) * 1.01,
            np.full(3, T / 100),
            *(np.full(shape, 1e-3) for shape in ((3, 3), 3, 3)),
            fit={"gravity": 9.81, "recording_digest": f"{T}"},
            sensor=Sensor(temperature_c=T),
        )
        for T in (20.0, 40.0)
    )
    values = {"CAL_ACC1_ID": 1310988.0, "SENS_BOARD_ROT": 0.0} | {
        f"CAL_ACC1_{axis}{kind}": value for kind, value in (("OFF", 0.0), ("SCALE", 1.0)) for axis in "XYZ"
    }
    six = {name: np.ones(6) for name in COEFFICIENTS}
    noise = Noise(six, six, six, np.ones(1), np.ones((1, 6)), np.ones(1), 100, 10.0, 10.0)
    merged = with_noise(merge([one, other]).calibration, noise)
    for row in (values, {}):
        entry = autopilot_document(Autopilot("PX4", 1, "HIGHRES_IMU", row), one)
        document = json.loads(replace(merged, extra={**merged.extra, "autopilot": entry}).json())
        VALIDATOR.validate(document)
        assert not unknown_keys(document, SCHEMA)


def test_wrong_documents_do_not_satisfy_the_schema(document):
    for part, key, wrong in (("accelerometer", "D", [[1, 0], [0, 1]]), ("quality", "verdict", "fine")):
        assert not VALIDATOR.is_valid(document | {part: document[part] | {key: wrong}})
    assert not VALIDATOR.is_valid(document | {"format": "mpucal.recording"})
