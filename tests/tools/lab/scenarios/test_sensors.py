import numpy as np
import pytest

from mpucal.simulated.sensor import SiSetting
from tools.lab.scenarios.sensors import euler_rotation, hand_sensor, non_orthogonality, paper_sensor, quantise


def rngs(n):
    return [np.random.default_rng(seed) for seed in range(n)]


def test_in_the_symmetric_frame_both_sensors_read_the_same():
    sensor = hand_sensor(np.random.default_rng(4))
    turned_one, Q = sensor.symmetric()
    np.testing.assert_array_equal(turned_one.K, turned_one.K.T)
    np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(Q) == pytest.approx(1.0)
    rng = np.random.default_rng(5)
    omega, s, none = rng.normal(size=(9, 3)), 9 * rng.normal(size=(9, 3)), np.zeros((9, 7))
    read, read_turned = (one.response(SiSetting(100.0)) for one in (sensor, turned_one))
    np.testing.assert_allclose(read_turned.values(s @ Q.T, omega @ Q.T, none), read.values(s, omega, none), atol=1e-12)


def test_a_perfect_gyroscope_needs_no_other_frame():
    sensor, Q = hand_sensor(np.random.default_rng(4), perfect_gyro=True).symmetric()
    np.testing.assert_allclose(sensor.K, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(Q, np.eye(3), atol=1e-15)


def test_sensors_of_the_paper_span_its_ranges():
    sensors = [paper_sensor(rng) for rng in rngs(300)]
    # rows of C_no R_mis have length 1: the gain is the row's
    gains = np.array([np.linalg.norm(sensor.D, axis=1) for sensor in sensors])
    assert 0.5 < gains.min() < 0.52
    assert 1.48 < gains.max() < 1.5
    assert 0.97 < np.abs([sensor.b_a for sensor in sensors]).max() < 1.0
    variances = np.array([sensor.response(SiSetting(100.0)).noise[:3] ** 2 for sensor in sensors])
    assert 1e-3 < variances.min() < 2e-3
    assert 0.098 < variances.max() < 0.1
    assert all(np.linalg.det(sensor.D) > 0 for sensor in sensors)


def test_a_hands_sensor_has_the_noise_of_its_density():
    response = hand_sensor(np.random.default_rng(0)).response(SiSetting(200.0))
    np.testing.assert_allclose(response.noise[:3], 0.0392266)  # 400 ug/sqrt(Hz) over 100 Hz
    np.testing.assert_allclose(np.degrees(response.noise[4:]), 0.05)
    still, normal = np.zeros((20000, 3)), np.random.default_rng(1).normal(size=(20000, 7))
    np.testing.assert_allclose(response.values(still, still, normal).std(0), response.noise, rtol=0.02)


def test_axes_that_are_not_skewed_are_the_identity():
    np.testing.assert_array_equal(non_orthogonality(0, 0, 0), np.eye(3))
    np.testing.assert_array_equal(euler_rotation(np.zeros(3)), np.eye(3))
    R = euler_rotation(np.array([0.1, -0.2, 0.3]))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(R[:, 2], [np.sin(-0.2), -np.sin(0.1) * np.cos(-0.2), np.cos(0.1) * np.cos(-0.2)])
    np.testing.assert_allclose(np.linalg.norm(non_orthogonality(0.5, -0.4, 0.3), axis=1), 1.0)


def test_quantisation_rounds_and_clips_and_says_where():
    y, clipped = quantise(np.array([[0.26, 0.0, -0.24], [1e9, 0.0, 0.0], [0.0, -1e9, 0.0]]), 0.5)
    np.testing.assert_array_equal(y, [[0.5, 0.0, 0.0], [0.5 * 32767, 0.0, 0.0], [0.0, -0.5 * 32768, 0.0]])
    np.testing.assert_array_equal(clipped, [False, True, True])
