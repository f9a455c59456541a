"""Verification of a perfect sensor, with a gyroscope that is exact, or whose turn is 1 deg too short."""

import numpy as np
import pytest

from mpucal.calibration.fit import Fit
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.calibration.verification import new_orientations
from mpucal.data import Recording, Sensor
from mpucal.rests.flat import flat_statistics

G, HZ, REST_S = 9.80665, 200.0, 3.0
KNOWN = Fit(
    D=np.eye(3),
    b_a=np.zeros(3),
    b_omega=np.zeros(3),
    K=np.eye(3),
    names=(*D_NAMES, *B_A_NAMES),
    covariance=1e-8 * np.eye(12),
    iterations=1,
    converged=True,
    nis=3.0,
    V=0.0,
)


def turned(turn_s, missing_deg, message=None, late=(), sway_deg=0.0):
    """Return the verification by a rest, a quarter turn about x at a constant rate, and a rest.

    Parameters
    ----------
    late : samples of the turn whose times are late by a period, as are all after them.
    sway_deg : by which the board turns on, slowly, as it rests the second time.
    """
    n_rest, n_turn = round(REST_S * HZ), round(turn_s * HZ)
    sways = np.radians(sway_deg) / REST_S * (1.0 - np.cos(2 * np.pi * np.arange(n_rest) / n_rest))
    rate = np.concatenate([np.zeros(n_rest), np.full(n_turn, 0.5 * np.pi / turn_s), sways])
    angle = np.cumsum(rate) / HZ
    rng = np.random.default_rng(1)
    acc = G * np.column_stack([0 * angle, np.sin(angle), np.cos(angle)]) + rng.normal(0, 0.01, (len(angle), 3))
    gyr = np.column_stack([rate * (1.0 - missing_deg / 90.0), 0 * rate, 0 * rate]) + rng.normal(0, 1e-3, acc.shape)
    times = np.arange(len(angle)) / HZ
    for sample in late:
        times[n_rest + sample :] += 1 / HZ
    recording = Recording.from_arrays(times, acc, gyr, sensor=Sensor(message=message))
    flat = flat_statistics(recording, (0, n_rest - 20))
    (rest,) = new_orientations(recording, flat, KNOWN, G, n_rest)
    return rest


@pytest.mark.parametrize(
    ("turn_s", "missing_deg", "agrees"), [(1.5, 0.0, True), (1.5, 1.0, False), (0.1, 1.0, True), (0.1, 4.0, False)]
)
def test_a_leap_is_carried_less_well_than_a_hands_turn(turn_s, missing_deg, agrees):
    rest = turned(turn_s, missing_deg)
    assert np.degrees(rest.direction) == pytest.approx(missing_deg, abs=0.1)
    assert rest.agrees == agrees


def test_an_arm_that_sways_as_it_rests_is_followed():
    """The mean of the rest is half a degree from where the turn ended; its rate passes in part for a sensitivity."""
    rest = turned(1.5, 0.0, sway_deg=1.0)
    assert np.degrees([rest.direction, rest.direction_std]) == pytest.approx([0.05, 0.07], abs=0.05)
    assert rest.agrees
    assert not turned(1.5, 1.0, sway_deg=1.0).agrees


def test_a_vehicles_samples_that_come_late_do_not_speak_against_the_calibration():
    late = range(20, 280, 40)
    of_chip, of_vehicle = (turned(1.5, 0.0, message, late) for message in (None, "SCALED_IMU"))
    assert np.degrees([of_chip.direction, of_vehicle.direction]) == pytest.approx([7 * 90 / 300] * 2, abs=0.1)
    assert (of_chip.agrees, of_vehicle.agrees, of_vehicle.clipped) == (False, True, True)


def test_late_samples_do_not_hide_what_they_cannot_explain():
    rest = turned(1.5, 8.0, "SCALED_IMU", range(20, 280, 40))
    assert not rest.agrees
