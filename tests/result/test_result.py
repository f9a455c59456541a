import json
import math
from dataclasses import fields, replace

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.errors import OutputError, RecordingError
from mpucal.result.calibration import Calibration
from mpucal.result.correlation import from_lower


@pytest.fixture
def calibration():
    random = np.random.default_rng(5)
    return Calibration(
        D=np.eye(3) + 0.1 * random.normal(size=(3, 3)),
        b_a=random.normal(size=3),
        D_std=np.full((3, 3), 1e-3),
        b_a_std=np.full(3, 2e-3),
        noise_std=np.full(3, 0.03),
        K=np.eye(3) + 0.01 * np.ones((3, 3)),
        b_omega=np.array([0.01, -0.02, 0.03]),
        fit={"model": "accel", "gravity": 9.82, "nis": 3.0, "converged": True, "iterations": np.int64(3)},
        quality={"verdict": "good", "reasons": [], "magnitude_after": {"median": np.float64(9.82)}},
        sensor=Sensor("MPU-6050", 0x68, 4.0, 500.0, 200.0, 30.0),
        created="2024-05-17T09:30:00+00:00",
        applied_in_hardware=np.array([0.1, 0.0, -0.1]),
        extra={"others": [Calibration(np.eye(3), np.ones(3)).document()]},
        correlation=from_lower(random.uniform(-1.0, 1.0, 210)),
    )


def same(a, b):
    for field in fields(Calibration):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other, field.name)
        else:
            assert one == other, field.name


def test_json_keeps_everything_to_the_last_bit(calibration, tmp_path):
    calibration.save(tmp_path / "calibration.json")
    same(Calibration.load(tmp_path / "calibration.json"), calibration)


def test_unknown_numbers_are_null_in_the_document_and_nan_in_python():
    calibration = Calibration(np.full((3, 3), math.nan), np.array([0.1, math.nan, -1e6]))
    document = json.loads(calibration.json())
    assert document["accelerometer"]["b_a"] == [0.1, None, -1e6]
    same(Calibration.from_document(document), calibration)


def test_the_document_has_the_keys_of_its_contract(calibration):
    document = json.loads(calibration.json())
    assert document["format"] == "mpucal.calibration"
    assert document["version"] == 1
    expected = {
        "accelerometer": {"D", "b_a", "D_std", "b_a_std", "noise_std", "formula"},
        "gyroscope": {"K", "b_omega", "K_std", "b_omega_std", "noise_std", "formula"},
        "sensor": {"chip", "who_am_i", "accel_range_g", "gyro_range_dps", "rate_hz", "temperature_c"},
        "applied_in_hardware": {"b_a"},
    }
    for key, inner in expected.items():
        assert set(document[key]) >= inner  # later versions only add keys
    assert document["accelerometer"]["formula"] == "a = inv(D) @ (y - b_a)"
    assert document["gyroscope"]["formula"] == "w = K @ (y - b_omega)"
    assert {"fit", "quality", "created", "others"} <= set(document)


def test_the_blob_keeps_the_numbers_as_float32(calibration, tmp_path):
    calibration.save(tmp_path / "calibration.bin")
    read = Calibration.load(tmp_path / "calibration.bin")
    for name in ("D", "b_a", "K", "b_omega", "applied_in_hardware"):
        np.testing.assert_array_equal(getattr(read, name), np.float32(getattr(calibration, name)), name)
    assert read.created == calibration.created
    assert read.fit["gravity"] == pytest.approx(9.82)
    assert read.sensor == Sensor(None, 0x68, 4.0, 500.0, None, 30.0)
    y = np.array([[0.5, -3.0, 9.0]])
    np.testing.assert_allclose(read.apply(y), calibration.apply(y), rtol=1e-5)


def test_apply_is_equation_4(calibration):
    s, w = np.array([[0.0, 0.0, 9.82], [5.0, -5.0, 6.8]]), np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.0]])
    y = s @ calibration.D.T + calibration.b_a - calibration.applied_in_hardware
    y_omega = w @ np.linalg.inv(calibration.K).T + calibration.b_omega
    np.testing.assert_allclose(calibration.apply(y), s, atol=1e-12)
    np.testing.assert_allclose(calibration.apply(y[0]), s[0], atol=1e-12)
    a, omega = calibration.apply(y, y_omega)
    np.testing.assert_allclose(a, s, atol=1e-12)
    np.testing.assert_allclose(omega, w, atol=1e-12)


def test_a_document_with_a_gain_and_a_bias_alone_is_enough():
    document = {
        "format": "mpucal.calibration",
        "accelerometer": {"D": np.eye(3).tolist(), "b_a": [1, 2, None]},
    }
    calibration = Calibration.from_document(document)
    np.testing.assert_array_equal(calibration.b_a, [1, 2, np.nan])
    np.testing.assert_array_equal(calibration.K, np.eye(3))
    assert np.isnan(calibration.D_std).all()
    assert calibration.verdict == "refused"  # nobody judged it
    # an unknown bias of the gyroscope is taken for zero
    _, omega = calibration.apply(np.zeros(3), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(omega, [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.json", b'{"format": "other"}', "'other', not 'mpucal.calibration'"),
        ("a.json", b'{"format": "mpucal.calibration", "version": 2}', "version 2 is newer"),
        ("a.bin", b"", "not a config blob"),
    ],
    ids=["another format", "newer", "empty blob"],
)
def test_files_that_hold_no_calibration(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=says) as raised:
        Calibration.load(tmp_path / name)
    assert str(tmp_path / name) in str(raised.value)


@pytest.mark.parametrize("D", [np.diag([1.0, 1.0, 1e-7]), 1e-4 * np.eye(3)], ids=["nearly singular", "tiny"])
def test_a_document_holds_no_matrix_that_a_blob_may_not_hold(calibration, tmp_path, D):
    with pytest.raises(ValueError, match="D has no inverse"):
        replace(calibration, D=D).save(tmp_path / "a.bin")
    document = calibration.document() | {"accelerometer": {"D": D.tolist(), "b_a": [0, 0, 0]}}
    with pytest.raises(ValueError, match="D cannot be inverted"):
        Calibration.from_document(document)


def test_places_that_cannot_be_read_or_written(calibration, tmp_path):
    with pytest.raises(RecordingError, match="No such file"):
        Calibration.load(tmp_path / "none.json")
    with pytest.raises(OutputError):
        calibration.save(tmp_path / "none" / "a.json")


def test_unknown_numbers_make_no_blob(calibration, tmp_path):
    with pytest.raises(ValueError, match="b_a holds a number that is not finite"):
        replace(calibration, b_a=np.array([0, np.nan, 0])).save(tmp_path / "a.bin")
    assert list(tmp_path.iterdir()) == []
