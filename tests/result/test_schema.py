"""The published schema of calibration.json, by jsonschema: every real output satisfies it, and wrong ones do not."""

import json
from copy import deepcopy
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import mpucal
from mpucal import calibration, result
from mpucal.result.document import ACCELEROMETER, EXTRA, GYROSCOPE, TEMPERATURE

FIXTURES = Path(__file__).parents[2] / "fixtures"
SCHEMA = json.loads((Path(result.__file__).parent / "calibration.schema.json").read_text())
VALIDATOR = Draft202012Validator(SCHEMA)


@pytest.fixture(scope="module")
def document():
    return json.loads(mpucal.calibrate(FIXTURES / "sessions" / "mpu6500.mcap", "accel").json())


def test_it_is_a_schema_and_knows_every_key_that_is_written():
    Draft202012Validator.check_schema(SCHEMA)
    known = SCHEMA["properties"]
    for key, rows in (("accelerometer", ACCELEROMETER + TEMPERATURE), ("gyroscope", GYROSCOPE)):
        assert {name for name, _, _ in rows} <= set(known[key]["properties"])
    assert set(EXTRA) <= set(known)
    assert set(known["fit"]["properties"]["model"]["enum"]) == set(calibration.MODELS)


def test_a_calibration_satisfies_it_and_so_does_a_refused_one(document):
    VALIDATOR.validate(document)
    recording = mpucal.load(FIXTURES / "sessions" / "mpu6500.mcap")
    refused = mpucal.calibrate(recording.part(0, 50))
    assert refused.verdict == "refused"
    VALIDATOR.validate(json.loads(refused.json()))


@pytest.mark.parametrize(
    ("where", "wrong"),
    [
        (("accelerometer", "D"), [[1, 0], [0, 1]]),
        (("accelerometer", "b_a"), [0, 0, "0"]),
        (("quality", "verdict"), "fine"),
        (("fit", "model"), "autoo"),
        (("format",), "mpucal.recording"),
    ],
)
def test_a_wrong_document_does_not(document, where, wrong):
    spoilt = deepcopy(document)
    *path, last = where
    inner = spoilt
    for key in path:
        inner = inner[key]
    inner[last] = wrong
    assert not VALIDATOR.is_valid(spoilt)
