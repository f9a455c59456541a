"""Rests that a fit has not seen, against what its covariance promises of them. Knows no session.

Two things can be wrong with a calibrated rest: its magnitude, which must be g, and its direction, which must be that of
the rest before it, as the gyroscope carries it there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..data import Recording, Vector
from .likelihood import K_NAMES
from .model import B_A_NAMES, D_NAMES, Fit, Flat, product, rotation
from .still import TREMOR_S, still_runs

# What nobody promises: a mounting is not stiffer, and the gyroscope's bias wanders while the board is turned.
FLOOR_MPS2, FLOOR_RAD = 0.01, np.deg2rad(0.1)
# Beyond so many standard deviations chance is no excuse.
MOST_STD = 4.0
LEAST_REST_S = 0.6


@dataclass(frozen=True)
class Rest:
    """One rest that the fit has not seen.

    Attributes
    ----------
    down : (3,) unit, what pointed down, calibrated. magnitude, magnitude_std : |a| - g and its promise [m/s^2].
    direction, direction_std : angle of gravity carried here to gravity here, and its promise [rad].
    turn : (3,) rad, how the board turned on its way here, in its own axes. miss : (3,) rad, that angle about its axis.
    clipped : the gyroscope was at the end of its range on that way: it says nothing of the direction.
    """

    down: Vector
    magnitude: float
    magnitude_std: float
    direction: float
    direction_std: float
    turn: Vector
    miss: Vector
    clipped: bool

    @property
    def magnitude_agrees(self) -> bool:
        """|a| is g as far as promised."""
        return abs(self.magnitude) <= MOST_STD * self.magnitude_std

    @property
    def direction_agrees(self) -> bool:
        """Gravity is where it was carried, as far as promised."""
        return self.clipped or self.direction <= MOST_STD * self.direction_std


def unseen_rests(recording: Recording, flat: Flat, fit: Fit, gravity: float, since: int) -> list[Rest]:
    """What the rests that begin after sample `since` say of `fit`, one after the other."""
    runs = [run for run in still_runs(recording, flat).tolist() if run[1] - run[0] >= LEAST_REST_S * recording.rate_hz]
    first = next((k for k, (a, _) in enumerate(runs) if a >= since), len(runs))
    return [_rest(recording, flat, fit, gravity, runs[k - 1], runs[k]) for k in range(max(first, 1), len(runs))]


def _rest(recording: Recording, flat: Flat, fit: Fit, gravity: float, before: list[int], here: list[int]) -> Rest:
    r = recording
    (a, b), (c, d) = before, here
    y, y_var = r.acc[c:d].mean(0), _mean_variance(r.acc[c:d], r.rate_hz)
    z, z_var = r.acc[a:b].mean(0), _mean_variance(r.acc[a:b], r.rate_hz)
    bias = 0.5 * (r.gyr[a:b].mean(0) + r.gyr[c:d].mean(0))
    bias_var = 0.25 * (_mean_variance(r.gyr[a:b], r.rate_hz) + _mean_variance(r.gyr[c:d], r.rate_hz))
    step = np.diff(r.t[b - 1 : c + 1])[:, None] * (0.5 * (r.gyr[b - 1 : c] + r.gyr[b : c + 1]) - bias)

    def calibrated(theta: Vector, mean: Vector) -> Vector:
        return np.asarray(np.linalg.solve(theta[:9].reshape(3, 3), mean - theta[9:12]))

    def miss(theta: Vector) -> Vector:
        K = _symmetric(theta[12:18])
        carried = product(rotation(-(step @ K.T))) @ calibrated(theta, z)
        return np.asarray(np.cross(_unit(carried), _unit(calibrated(theta, y))))

    theta, covariance = _theta(fit)
    s = calibrated(theta, y)
    inverse = np.linalg.inv(fit.D)
    by_theta = _slope(lambda x: np.array([np.linalg.norm(calibrated(x, y))]), theta)
    along = _unit(s) @ inverse
    magnitude_var = (by_theta @ covariance @ by_theta.T).item() + float(along**2 @ y_var) + FLOOR_MPS2**2
    by_theta = _slope(miss, theta)
    seconds = float(r.t[c] - r.t[b - 1])
    gyro_var: float = float(np.sum(np.diff(r.t[b - 1 : c + 1]) ** 2)) * flat.Sigma_omega.mean() * 2.0
    direction_var = (
        float(np.trace(by_theta @ covariance @ by_theta.T))
        + gyro_var
        + bias_var.sum() * seconds**2
        + (y_var.sum() + z_var.sum()) / gravity**2
        + FLOOR_RAD**2
    )
    e = miss(theta)
    return Rest(
        down=-_unit(s),
        magnitude=float(np.linalg.norm(s) - gravity),
        magnitude_std=float(np.sqrt(magnitude_var)),
        direction=float(np.arcsin(min(np.linalg.norm(e), 1.0))),
        direction_std=float(np.sqrt(float(direction_var))),
        turn=step.sum(0) @ fit.K.T,
        miss=e,
        clipped=bool(r.gyr_clipped[b - 1 : c + 1].any() or r.gap[b : c + 1].any()),
    )


def _theta(fit: Fit) -> tuple[Vector, Vector]:
    """(18,) D, b_a and K's six, and their covariance; zero for those that were not estimated."""
    names = (*D_NAMES, *B_A_NAMES, *K_NAMES)
    place = {name: i for i, name in enumerate(fit.names)}
    covariance = np.zeros((18, 18))
    known = [i for i, name in enumerate(names) if name in place]
    at = [place[names[i]] for i in known]
    covariance[np.ix_(known, known)] = fit.covariance[np.ix_(at, at)]
    return np.concatenate([fit.D.ravel(), fit.b_a, fit.K[np.triu_indices(3)]]), covariance


def _slope(function: Callable[[Vector], Vector], theta: Vector) -> Vector:
    """(m, 18) derivatives by central differences: a promise needs no more digits."""
    h = 1e-5
    steps = h * np.eye(len(theta))
    return np.stack([(function(theta + step) - function(theta - step)) / (2.0 * h) for step in steps], axis=1)


def _mean_variance(part: Vector, rate_hz: float) -> Vector:
    """(3,) variance of the mean of a rest, whose tremor is correlated."""
    independent = max(len(part) / (1.0 + 2.0 * TREMOR_S * rate_hz), 1.0)
    return np.asarray(part.var(0) / independent)


def _symmetric(six: Vector) -> Vector:
    K = np.zeros((3, 3))
    K[np.triu_indices(3)] = six
    return np.asarray(K + np.triu(K, 1).T)


def _unit(v: Vector) -> Vector:
    return np.asarray(v / max(float(np.linalg.norm(v)), 1e-9))
