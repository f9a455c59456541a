"""Simulated sensor: its truth, and its response to a motion."""

import numpy as np
import pytest

from mpucal.chip.families import MPU6050, MPU6500
from mpucal.result.error_model import misalignment
from mpucal.simulated.sensor import SensorTruth, Setting

G0 = 9.80665
STILL = np.tile([0.0, 0.0, 9.81], (4000, 1))
NO_TURN = np.zeros((4000, 3))


def setting(rate_hz=200.0, accel_range_g=4.0, gyro_range_dps=500.0, **offsets):
    return Setting(rate_hz, accel_range_g, gyro_range_dps, 340.0, 36.53, **offsets)


def counts(truth, how, force=STILL, omega=NO_TURN):
    return truth.response(how).counts(force, omega, np.random.default_rng(0))


@pytest.mark.parametrize(("chip", "sheet"), [("mpu6050", MPU6050), ("mpu6500", MPU6500)])
def test_a_drawn_sensor_lies_within_the_data_sheet(chip, sheet):
    """Compare 50 sensors with the tolerances, and find each tolerance nearly used up by one of them."""
    truths = [SensorTruth.draw(seed, chip) for seed in range(50)]
    D, gyro = np.array([truth.D for truth in truths]), np.array([np.linalg.inv(truth.K) for truth in truths])
    assert all(np.array_equal(truth.K, truth.K.T) for truth in truths)
    off = ~np.eye(3, dtype=bool)
    angles = np.tan(np.radians([misalignment(matrix)[off] for matrix in D]))
    shares = {
        "scale factors": 100 * (np.diagonal(D, axis1=1, axis2=2) - 1) / sheet.scale_percent,
        "cross-axis": 100 * angles / sheet.cross_axis_percent,
        "bias": 1000 / G0 * np.array([truth.b_a for truth in truths]) / sheet.zero_g_mg,
        "gyro's scale factors": 100 * (np.diagonal(gyro, axis1=1, axis2=2) - 1) / sheet.scale_percent,
        "gyro's cross-axis": 100 * gyro[:, off] / sheet.cross_axis_percent,
        "gyro's bias": np.degrees([truth.b_omega for truth in truths]) / sheet.zero_rate_dps,
        "clock": np.array([[truth.rate_error_ppm] for truth in truths]) / 8000,
    }
    for name, share in shares.items():
        assert 0.8 < np.abs(share).max() <= 1 + 1e-9, name


@pytest.mark.parametrize(("rate_hz", "g", "dps"), [(100.0, 16.0, 2000.0), (1000.0, 2.0, 250.0)])
def test_counts_at_rest_have_the_truth_as_mean_and_the_density_as_spread(rate_hz, g, dps):
    truth = SensorTruth.draw(3)
    seen = counts(truth, setting(rate_hz, g, dps)).astype(float)
    lsb_per_g, lsb_per_dps = 32768 / g, 131 * 250 / dps
    force = truth.D[:, 2] * 9.81 + truth.b_a
    acc, gyr = (density * np.sqrt(rate_hz / 2) for density in (400e-6 * lsb_per_g, 0.005 * lsb_per_dps))
    means = seen.mean(axis=0)
    np.testing.assert_allclose(means[:3], force / G0 * lsb_per_g, atol=4.5 * acc / np.sqrt(len(seen)) + 0.1)
    rest = np.degrees(truth.b_omega) * lsb_per_dps
    np.testing.assert_allclose(means[4:], rest, atol=4.5 * gyr / np.sqrt(len(seen)) + 0.1)
    assert seen[:, 3].mean() / 340 + 36.53 == pytest.approx(truth.temperature_c, abs=0.01)
    rounding = 1 / 12
    np.testing.assert_allclose(seen[:, :3].std(axis=0), np.sqrt(acc**2 + rounding), rtol=0.05)
    # a spread below the step is rounded to one of two counts
    if gyr > 0.5:
        np.testing.assert_allclose(seen[:, 4:].std(axis=0), np.sqrt(gyr**2 + rounding), rtol=0.05)
