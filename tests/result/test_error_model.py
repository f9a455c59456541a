"""Scale factor error, misalignment and bias against a turntable's six positions, and their deviations against draws."""

import numpy as np
import pytest

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.result import error_model
from mpucal.simulated.sensor import SensorTruth


@pytest.fixture
def true():
    return SensorTruth.draw(1)


def test_six_positions_measure_the_same(true):
    """Each body axis up and down: what a sensor reads then, by the textbook's half sums and half differences."""
    up, down = (true.D @ (sign * G * np.eye(3)) + true.b_a[:, None] for sign in (1.0, -1.0))
    response = (up - down) / (2.0 * G)
    np.testing.assert_allclose(error_model.scale_factor_error(true.D), 100.0 * (np.diag(response) - 1.0), atol=1e-9)
    np.testing.assert_allclose(error_model.bias_mg(true.b_a), ((up + down) / 2.0).mean(1) / G * 1000.0)
    angle = error_model.misalignment(true.D)
    for i, j in ((0, 1), (1, 2), (2, 0), (1, 0)):
        # the axis points to where it reads most
        at = np.radians(np.linspace(-10.0, 10.0, 200_001))
        reading = response[i, i] * np.cos(at) + response[i, j] * np.sin(at)
        assert angle[i, j] == pytest.approx(np.degrees(at[np.argmax(reading)]), abs=2e-4)
    assert np.isnan(np.diag(angle)).all()


def test_deviations_are_those_of_draws(true):
    rng = np.random.default_rng(3)
    std = rng.uniform(1e-4, 1e-3, (3, 3))
    draws = [true.D + std * rng.normal(size=(3, 3)) for _ in range(10_000)]
    for value, claimed in (
        (error_model.scale_factor_error, error_model.scale_factor_error_std(std)),
        (error_model.misalignment, error_model.misalignment_std(true.D, std)),
    ):
        np.testing.assert_allclose(np.std([value(D) for D in draws], axis=0), claimed, rtol=0.04)


def test_seen_along_its_own_axes_a_swapped_and_turned_sensor_keeps_its_scale_factors():
    turned = np.eye(3)[[1, 2, 0]] * [-1.0, 1.0, 1.0]
    scales = np.array([0.98, 2.1, 1.3])
    np.testing.assert_allclose(np.diag(error_model.sensor_axes(np.diag(scales) @ turned)), scales)
