import numpy as np
import pytest

from mpucal.simulated.study.sensors import hand_sensor, misaligned, non_orthogonality, paper_sensor, quantised


def rngs(n):
    return [np.random.default_rng(seed) for seed in range(n)]


def test_in_the_symmetric_frame_both_sensors_read_the_same():
    sensor = hand_sensor(np.random.default_rng(4), 200.0)
    K, Q = sensor.symmetric_frame()
    np.testing.assert_allclose(K, K.T, atol=1e-15)
    np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(Q) == pytest.approx(1.0)
    omega, s = np.array([0.3, -1.0, 2.0]), np.array([1.0, 5.0, -8.0])
    np.testing.assert_allclose(K @ (sensor.G @ omega), Q @ omega, atol=1e-12)
    np.testing.assert_allclose((sensor.D @ Q.T) @ (Q @ s), sensor.D @ s, atol=1e-12)


def test_a_perfect_gyroscope_needs_no_other_frame():
    K, Q = hand_sensor(np.random.default_rng(4), 200.0, perfect_gyro=True).symmetric_frame()
    np.testing.assert_allclose(K, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(Q, np.eye(3), atol=1e-15)


def test_sensors_of_the_paper_span_its_ranges():
    sensors = [paper_sensor(rng) for rng in rngs(300)]
    # rows of C_no R_mis have length 1: the gain is the row's
    gains = np.array([np.linalg.norm(sensor.D, axis=1) for sensor in sensors])
    assert 0.5 < gains.min() < 0.52
    assert 1.48 < gains.max() < 1.5
    assert 0.97 < np.abs([sensor.b_a for sensor in sensors]).max() < 1.0
    variances = np.array([sensor.sigma_a**2 for sensor in sensors])
    assert 1e-3 < variances.min() < 2e-3
    assert 0.098 < variances.max() < 0.1
    assert all(np.linalg.det(sensor.D) > 0 for sensor in sensors)


def test_a_hands_sensor_has_the_noise_of_its_density():
    sensor = hand_sensor(np.random.default_rng(0), 200.0)
    np.testing.assert_allclose(sensor.sigma_a, 0.0392266)  # 400 ug/sqrt(Hz) over 100 Hz
    np.testing.assert_allclose(np.degrees(sensor.sigma_omega), 0.05)
    still = np.zeros((20000, 3))
    acc, _ = sensor.accelerometer(still, np.random.default_rng(1))
    gyr, _ = sensor.gyroscope(still, np.random.default_rng(2))
    np.testing.assert_allclose(acc.std(0), sensor.sigma_a, rtol=0.02)
    np.testing.assert_allclose(gyr.std(0), sensor.sigma_omega, rtol=0.02)


def test_axes_that_are_not_skewed_are_the_identity():
    np.testing.assert_array_equal(non_orthogonality(0, 0, 0), np.eye(3))
    np.testing.assert_array_equal(misaligned(0, 0, 0), np.eye(3))
    R = misaligned(0.1, -0.2, 0.3)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(non_orthogonality(0.5, -0.4, 0.3), axis=1), 1.0)


def test_quantisation_rounds_and_clips_and_says_where():
    y, clipped = quantised(np.array([[0.26, 0.0, -0.24], [1e9, 0.0, 0.0], [0.0, -1e9, 0.0]]), 0.5)
    np.testing.assert_array_equal(y, [[0.5, 0.0, 0.0], [0.5 * 32767, 0.0, 0.0], [0.0, -0.5 * 32768, 0.0]])
    np.testing.assert_array_equal(clipped, [False, True, True])
