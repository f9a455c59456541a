"""Verification of a fit by orientations that it has not seen, with the predictions of its covariance.

At rest, the calibrated magnitude must be g, and the direction that of the rest before, as the gyroscope carries it.
Both errors are compared with their predicted standard deviations (1 sigma).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..clocks.sample_clock import MISSING_INTERVALS
from ..data import Recording, Vector
from ..origin import Origin
from ..rests.flat import Flat
from ..rests.gyro_drift import remove_drift
from ..rests.intervals import RestFinder, block_means
from ..result.calibration import Calibration
from .fit import Fit
from .hypothesis_tests import MOST_STD
from .parameters import NAMES
from .rotation import turn_by_matrix
from .transitions import by_accelerometer, miss_jacobians

# Errors in no covariance: a mounting is not perfectly stiff, and the gyroscope's bias wanders during the turning.
FLOOR_MPS2, FLOOR_RAD, BIAS_RAD_S = 0.003, math.radians(0.05), math.radians(0.02)
LEAST_REST_S, BLOCK_S = 0.75, 0.25


@dataclass(frozen=True)
class NewOrientation:
    """Orientation that the fit has not seen; `_std` are predicted standard deviations.

    Attributes
    ----------
    down : (3,) unit, the calibrated direction that points down. magnitude, magnitude_std : |a| - g [m/s^2].
    direction, direction_std : angle between gravity as carried here and gravity here [rad].
    turn : (3,) rad, the turn on the way here, in the board's axes. miss : (3,) rad, `direction` about its axis.
    clipped : the gyroscope clipped on the way, or samples are missing, so that the direction cannot be compared. A
        vehicle's samples count as missing where the intervals that are too long explain an error of the direction.
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
        """True if |a| is g within the prediction."""
        return abs(self.magnitude) <= MOST_STD * self.magnitude_std

    @property
    def agrees(self) -> bool:
        """True if magnitude and direction both agree."""
        return self.magnitude_agrees and self.direction_agrees

    @property
    def direction_agrees(self) -> bool:
        """True if gravity is where the gyroscope carried it, within the prediction."""
        return self.clipped or self.direction <= MOST_STD * self.direction_std


def new_orientations(recording: Recording, flat: Flat, fit: Fit, gravity: float, since: int) -> list[NewOrientation]:
    """Verify `fit` by the rests that begin after sample `since`, one after the other."""
    rests = RestFinder(recording, flat)
    runs = rests.any_hand()
    recording = remove_drift(recording, flat, rests.bias_runs(runs))
    long = [(a, b) for a, b in runs.tolist() if b - a >= LEAST_REST_S * recording.rate_hz]
    first = next((k for k, (a, _) in enumerate(long) if a >= since), len(long))
    return [_verify(recording, flat, fit, gravity, long[k - 1], long[k]) for k in range(max(first, 1), len(long))]


def _verify(
    r: Recording, flat: Flat, fit: Fit, gravity: float, start: tuple[int, int], end: tuple[int, int]
) -> NewOrientation:
    """Compare the rest `end` with the fit, and with the rest before it as the gyroscope's steps carry it."""
    (a, b), (c, d) = start, end
    between = slice(b - 1, c + 1)
    # An arm sways as it rests: its readings are carried to the sample where the turn begins, or ends.
    z, z_var = _mean(carried(r, flat, fit, slice(a, b), -1), r.rate_hz)
    y, y_var = _mean(carried(r, flat, fit, slice(c, d), 0), r.rate_hz)
    dt, rates, noise = turn_between(r, flat, b - 1, c)
    steps = dt[:, None] * rates
    # The mean of two rates is not the rate between them: the trapezoidal rule errs by their second difference.
    bends = np.diff(r.gyr[between], n=2, axis=0) * dt[1:, None] / 12.0
    gyro_var = 2.0 * noise + float(np.sum(bends * bends))
    inverse, at = np.asarray(np.linalg.inv(fit.D), np.float64), [NAMES.index(name) for name in fit.names]
    leaving, s = (z - fit.b_a) @ inverse.T, (y - fit.b_a) @ inverse.T
    F, phi = turn_by_matrix(steps, fit.K, np.array([[0, len(steps)]]))
    gravities = float(np.linalg.norm(leaving) * np.linalg.norm(s))
    miss = np.cross(F[0] @ leaving, s) / gravities
    of_miss = miss_jacobians(F, leaving[None], s[None], inverse, phi)[0][:, at]
    up = s / np.linalg.norm(s)
    of_length = up @ by_accelerometer(inverse, s[None])[0][:, at]
    length_var = float(of_length @ fit.covariance @ of_length + (up @ inverse) ** 2 @ y_var)
    miss_var = float(np.trace(of_miss @ fit.covariance @ of_miss.T)) + gyro_var
    miss_var += float(y_var.sum() + z_var.sum()) / gravity**2
    direction = math.asin(min(float(np.linalg.norm(miss)), 1.0))
    direction_std = math.hypot(math.sqrt(miss_var), FLOOR_RAD)
    late = np.where(dt > MISSING_INTERVALS / r.rate_hz, dt - 1.0 / r.rate_hz, 0.0)
    unsure_rad = float(late @ np.linalg.norm(rates, axis=1)) if r.sensor.origin is Origin.VEHICLE else 0.0
    clipped = bool(r.gyr_clipped[between].any() or r.gap[b : c + 1].any())
    return NewOrientation(
        down=-up,
        magnitude=float(np.linalg.norm(s) - gravity),
        magnitude_std=math.hypot(math.sqrt(length_var), FLOOR_MPS2),
        direction=direction,
        direction_std=direction_std,
        turn=steps.sum(0) @ fit.K.T,
        miss=miss,
        clipped=clipped or 0.0 < direction - MOST_STD * direction_std <= unsure_rad,
    )


def turn_between(recording: Recording, flat: Flat, first: int, last: int) -> tuple[Vector, Vector, float]:
    """Return the steps of a turn from one sample to another: durations (n,) [s] and mean rates (n, 3) [rad/s].

    The third value is the turn's variance [rad^2 an axis], by the gyroscope's noise and a bias that wanders.
    """
    dt, gyr = np.diff(recording.t[first : last + 1]), recording.gyr
    rates = 0.5 * (gyr[first:last] + gyr[first + 1 : last + 1]) - flat.b_omega
    return dt, rates, float(dt @ dt) * float(flat.Sigma_omega.mean()) + (BIAS_RAD_S * float(dt.sum())) ** 2


def carried(recording: Recording, flat: Flat, known: Fit | Calibration, rest: slice, to: int) -> Vector:
    """Return the readings (n, 3) of a rest as they are in the axes of its sample number `to`; a rest turns little.

    [m/s^2], by the D, b_a and K of `known`; as transitions.py does for the means of all rests of a fit at once.
    """
    acc = recording.acc[rest]
    steps = np.gradient(recording.t[rest])[:, None] * ((recording.gyr[rest] - flat.b_omega) @ known.K.T)
    path = np.cumsum(steps, axis=0)
    s = np.linalg.solve(known.D, (acc - known.b_a).T).T
    return np.asarray(acc + np.cross(path - path[to], s) @ known.D.T)


def _mean(part: Vector, rate_hz: float) -> tuple[Vector, Vector]:
    """Return the mean (3,) of a rest, and its variance by the spread of shorter means, as a tremor is not white."""
    n = max(round(BLOCK_S * rate_hz), 1)
    blocks = block_means(part, n)
    return part.mean(0), blocks.var(0, ddof=1) / len(blocks)
