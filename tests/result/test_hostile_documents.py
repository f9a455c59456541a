"""calibration.json changed by an attacker or a bad disk: one sentence, or the numbers that were saved."""

import json
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.data import Sensor
from mpucal.errors import RecordingError, UsageError
from mpucal.result.calibration import Calibration
from mpucal.result.correction import make_correction

ONE = Calibration(
    np.eye(3) * 1.01,
    np.array([0.1, -0.2, 0.3]),
    *(np.full(shape, 1e-3) for shape in ((3, 3), 3, 3)),
    fit={"model": "imu", "gravity": 9.81},
    quality={"verdict": "good", "reasons": []},
    created="2024-05-17T09:30:00+00:00",
    b_a_slope=np.full(3, 0.01),
    temperature_range_c=np.array([20.0, 40.0]),
    sensor=Sensor(temperature_c=25.0),
    correlation=np.eye(21) + 0.5 * (np.eye(21, k=1) + np.eye(21, k=-1)),
)
ONE = replace(ONE, extra={"others": [ONE.document()], "autopilot": {"params_old": {"INS_ACCOFFS_X": 0.0}, "imu": 1}})


def loaded(folder, text):
    path = folder / "calibration.json"
    path.write_bytes(text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text)
    return Calibration.load(path)


@pytest.mark.parametrize(
    ("where", "wrong"),
    [
        ("accelerometer D", [[1, 1, 1], [1, 1, 1], [1, 1, 1]]),
        ("accelerometer b_a 0", True),
        ("accelerometer b_a 0", 1e300),
        ("accelerometer D_std 0 0", -1e-3),
        ("accelerometer D 0", [None] * 3),
        ("accelerometer temperature_range_c", [50.0, 20.0]),
        ("applied_in_hardware b_a", [None] * 3),
        ("correlation", [0.0] * 209),
        ("correlation 7", 1.5),
        ("quality reasons", [{"code": "\x1b[2J", "message": ""}]),
        ("fit gravity", -9.81),
        ("sensor accel_range_g", -4),
        ("sensor accel_offsets", [10**18] * 3),
        ("sensor chip", "\ud800"),
        ("created", "yesterday"),
        ("autopilot params_old INS_ACCOFFS_X", "1"),
        ("later", 1e300),
        ("others 0 accelerometer D", [[0, 0, 0]] * 3),
        ("later", reduce(lambda inner, _: [inner], range(100), 0)),
        ("later", "x" * 70_000),
    ],
)
def test_a_wrong_document_is_reported_in_one_sentence(tmp_path, where, wrong):
    document = json.loads(ONE.json())
    *path, last = [int(key) if key.isdecimal() else key for key in where.split()]
    inner = reduce(lambda value, key: value[key], path, document)
    inner[last] = wrong
    with pytest.raises(RecordingError) as raised:
        loaded(tmp_path, json.dumps(document, ensure_ascii=False))
    assert "holds no calibration" in str(raised.value)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 400


@pytest.mark.parametrize(
    "text",
    ['{"a":' * 100_000, '{"a": 1' + "0" * 5000 + "}", '{"a": NaN}', '{"a": 1, "a": 2}', b'"\xff"'],
    ids=["objects", "digits", "NaN", "twice", "no UTF-8"],
)
def test_no_json_is_one_sentence(tmp_path, text):
    with pytest.raises(RecordingError, match="holds no calibration"):
        loaded(tmp_path, text)


def test_a_file_without_digest_is_doubted_and_one_of_equal_numbers_is_not(tmp_path):
    document = json.loads(ONE.json())
    assert not loaded(tmp_path, ONE.json()).doubt
    # written by a language without integers
    as_others = ONE.json().replace("0.0,", "0,").replace('": 1.0', '": 1')
    assert as_others != ONE.json()
    assert not loaded(tmp_path, as_others).doubt
    del document["digest"]
    document["later"] = {"a": [1, "two", None, True]}  # a key that is not known is no reason either
    assert "no digest" in loaded(tmp_path, json.dumps(document)).doubt
    assert loaded(tmp_path, json.dumps(document)) == ONE


@settings(max_examples=60)
@given(at=st.integers(0, 8 * len(ONE.json()) - 1))
def test_no_bit_that_flips_changes_a_number_without_a_word(tmp_path_factory, at):
    data = bytearray(ONE.json().encode())
    data[at // 8] ^= 1 << at % 8
    try:
        read = loaded(tmp_path_factory.getbasetemp(), bytes(data))
    except RecordingError:
        return
    assert read.doubt or replace(read, created=ONE.created) == ONE  # its date is not a number


@pytest.mark.parametrize("unknown", ["D", "K"])
def test_unknown_parameters_are_not_applied(tmp_path, unknown):
    read = loaded(tmp_path, replace(ONE, **{unknown: np.full_like(getattr(ONE, unknown), np.nan)}).json())
    assert read.verdict == "good"
    with pytest.raises(UsageError, match="the calibration lacks"):
        make_correction(read, Sensor())


def test_a_pipe_or_device_is_no_file(tmp_path):
    for name in ("calibration.json", "calibration.bin"):
        (tmp_path / name).symlink_to("/dev/zero")
        with pytest.raises(RecordingError, match="is a pipe or device, not a file"):
            Calibration.load(tmp_path / name)
