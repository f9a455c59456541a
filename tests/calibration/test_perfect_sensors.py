"""Sensors that may be nearly perfect: what their kind's weight does to an estimate that was made without it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.calibration.fit import Fit
from mpucal.calibration.parameters import NAMES, PLACES
from mpucal.calibration.perfect_sensors import weigh_perfect_sensors

YAW_45 = Rotation.from_euler("z", 45, degrees=True).as_matrix()


def estimate(D=None, K=None, angles_sd=5e-4, K_sd=5e-3):
    """An estimate whose bias along x is as wrong as ten times its D_xy, and whose D_xz is as wrong as its K_xz."""
    D, K = np.eye(3) if D is None else D, np.eye(3) if K is None else K
    sd = np.full(len(NAMES), 1e-3)
    sd[PLACES["D"]] = np.where(np.eye(3) > 0, 1e-5, angles_sd).ravel()
    sd[PLACES["b_a"]], sd[PLACES["K"]] = 1e-4, K_sd
    mix = np.eye(len(NAMES))
    mix[PLACES["b_a"].start, PLACES["D"].start + 1] = 10.0
    mix[PLACES["D"].start + 2, PLACES["K"].start + 2] = 1.0
    covariance = mix @ np.diag(sd**2) @ mix.T
    return Fit(D, np.zeros(3), np.zeros(3), K, NAMES, covariance, 1, True, 3.0, 0.0)


def off(**elements):
    matrix = np.eye(3)
    for name, value in elements.items():
        matrix["xyz".index(name[0]), "xyz".index(name[1])] = value
    return matrix


def test_axes_that_are_nearly_square_are_taken_for_square():
    before = estimate(off(xy=4e-4, yx=3e-4))
    after = weigh_perfect_sensors(before, np.eye(3))
    assert abs(after.D[0, 1] + after.D[1, 0]) < 1e-4
    # The error of the bias that came with that of the angle goes with it.
    assert after.b_a[0] == pytest.approx(-10 * (4e-4 - after.D[0, 1]), rel=0.01)
    assert (np.diag(after.covariance) <= np.diag(before.covariance) + 1e-15).all()
    assert np.linalg.eigvalsh(after.covariance).min() > 0


@pytest.mark.parametrize("element", [{"xy": 0.006}, {"yz": -0.004}])
def test_axes_that_are_skew_stay_so(element):
    before = estimate(off(**element))
    after = weigh_perfect_sensors(before, np.eye(3))
    # The data sheet's tolerance draws them nearer by (5e-4 / 0.012)^2.
    assert pytest.approx(before.D, abs=2e-5) == after.D


def test_a_turned_sensor_is_judged_in_its_own_axes():
    # Its scale factors differ, so that square axes look skew in those of the vehicle.
    before = estimate(YAW_45 @ np.diag([1.02, 0.98, 1.0]) @ YAW_45.T)
    assert pytest.approx(before.D, abs=1e-9) == weigh_perfect_sensors(before, YAW_45).D
    assert pytest.approx(before.D, abs=1e-5) != weigh_perfect_sensors(before, np.eye(3)).D


def test_a_gyroscope_that_is_nearly_perfect_corrects_what_it_carried():
    before = estimate(off(xz=0.004), off(xz=0.004, zx=0.004), K_sd=np.array([1e-4, 4e-3, 4e-3, 1e-4, 4e-3, 1e-4]))
    after = weigh_perfect_sensors(before, np.eye(3))
    assert abs(after.K[0, 2]) < 5e-4 and after.K[0, 2] == after.K[2, 0]
    assert abs(after.D[0, 2]) < 5e-4


def test_a_gyroscope_that_is_not_keeps_its_own():
    before = estimate(np.eye(3), off(xx=1.02, xz=0.004, zx=0.004))
    after = weigh_perfect_sensors(before, np.eye(3))
    assert pytest.approx(before.K, abs=1e-4) == after.K


def test_an_estimate_without_a_gyroscope_stays():
    covariance = estimate().covariance[:12, :12]
    before = Fit(np.eye(3), np.zeros(3), np.zeros(3), np.eye(3), NAMES[:12], covariance, 1, True, 3.0, 0.0)
    assert weigh_perfect_sensors(before, np.eye(3)) is before
