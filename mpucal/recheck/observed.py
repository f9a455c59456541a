"""Residuals of a calibration in a recording of rests and turns, and their Jacobian: r = J theta + noise.

theta are the 23 errors of a calibration in the body frame, those of D, b_a, K, b_omega and of the noise:

    E (9)       the accelerometer's matrix is D (I + E), row-major
    beta (3)    its bias is b_a + D beta [m/s^2]
    G (6)       the gyroscope's matrix is (I + G) K, symmetric: xx, xy, xz, yy, yz, zz
    delta (3)   its bias is b_omega + delta [rad/s]
    nu (2)      noise of the accelerometer and of the gyroscope, times e^nu

The calibrated mean of a rest is then a = s + E s + beta + noise, with the true specific force s. The residuals r are:

    |a| - g of each rest
    the direction of a, as the angle (2 components) from that of the rest before, carried on by the gyroscope
    the mean rate of the first rest less b_omega
    the logarithm of the noise in the flat segment, relative to the calibration's, unless something shook the board
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..calibration.masks import with_masks
from ..calibration.rotation import cross, turn_by_matrix
from ..calibration.verification import (
    BIAS_RAD_S,
    BLOCK_S,
    FLOOR_MPS2,
    FLOOR_RAD,
    LEAST_REST_S,
    carried,
    turn_between,
)
from ..calibration.words import decode
from ..data import Recording, Vector
from ..rests.flat import Flat, find_flat, flat_statistics, is_long_enough
from ..rests.gyro_drift import remove_drift
from ..rests.intervals import Intervals, RestFinder, block_means
from ..rests.limits import LEAST_TURN_RAD
from ..result.calibration import Calibration
from ..result.correlation import UPPER

E, BETA, G, DELTA, NOISE = slice(0, 9), slice(9, 12), slice(12, 18), slice(18, 21), slice(21, 23)
# A calibration states a covariance of the first 21.
CALIBRATED, PARAMETERS = DELTA.stop, NOISE.stop
# Standard deviation of a turn, relative to its angle, by the gyroscope's nonlinearity (PS-MPU-6000A r3.4, section 6.1:
# 0.2 % of full scale).
TURN_NONLINEARITY = 0.001
# The variance of a rest's mean follows from the variation of this number of block means: they are long enough for a
# tremor to average out, but not for a sway.
BLOCKS_A_REST = 4
# A rest has few blocks, so its variance is pooled with that of the others, which counts as these degrees of freedom.
POOLED_FREEDOM = 6.0
# The flat rest and three more.
LEAST_ORIENTATIONS = 4
# The variance of means over this time [s] is that of n samples divided by n, if they are of noise. If it is larger by
# more than this factor, the board is shaken.
SHAKEN_S, MOST_SHAKEN_RATIO = 0.1, 4.0
# Samples behind a low-pass filter are correlated: they count as at least this share of independent samples.
LEAST_INDEPENDENT = 0.2


@dataclass(frozen=True)
class Observations:
    """Observations of a recording: r = J theta + noise of covariance R.

    Attributes
    ----------
    r : (m,) magnitudes [m/s^2], angles [rad], rate [rad/s] and logarithms of noise. J : (m, 23). R : (m, m).
    down : (k, 3) unit vectors, calibrated: the direction that pointed down in each rest.
    temperature_c : mean of the chip's; None where it is not known. seconds : length of the recording.
    """

    r: Vector
    J: Vector
    R: Vector
    down: Vector
    temperature_c: float | None
    seconds: float

    @property
    def orientations(self) -> int:
        """Number of orientations that differ by 20 deg from each other."""
        apart: list[Vector] = []
        for down in self.down:
            if all(float(down @ other) <= math.cos(LEAST_TURN_RAD) for other in apart):
                apart.append(down)
        return len(apart)


def apply_errors(calibration: Calibration, theta: Vector) -> Calibration:
    """Return the calibration corrected by its errors theta (23,)."""
    twist = np.zeros((3, 3))
    twist[UPPER] = theta[G]
    twist += np.triu(twist, 1).T
    noise = np.exp(theta[NOISE])
    return replace(
        calibration,
        D=calibration.D @ (np.eye(3) + theta[E].reshape(3, 3)),
        b_a=calibration.b_a + calibration.D @ theta[BETA],
        K=(np.eye(3) + twist) @ calibration.K,
        b_omega=calibration.b_omega + theta[DELTA],
        noise_std=noise[0] * calibration.noise_std,
        gyro_noise_std=noise[1] * calibration.gyro_noise_std,
    )


def observe(recording: Recording, calibration: Calibration) -> Observations | None:
    """Return the observations of a recording; None if the board never rests."""
    gravity = calibration.gravity
    recording = with_masks(decode(recording).recording)
    segment = recording.flat or find_flat(recording)
    if segment is None or not is_long_enough(recording, segment):
        return None
    flat = flat_statistics(recording, segment)
    found = RestFinder(recording, flat)
    runs = found.typical()
    runs = runs[runs[:, 1] - runs[:, 0] >= LEAST_REST_S * recording.rate_hz]
    if not len(runs):
        return None
    T = recording.temperature_c
    known = bool(np.isfinite(T).any())
    has_rates = bool(np.isfinite(recording.gyr).all())
    mended = remove_drift(recording, flat, found.bias_runs(runs)) if has_rates else recording
    # A hand sways as it rests. So the gyroscope turns each reading into the orientation in the middle of its rest, from
    # which the turn to the next rest is computed.
    readings = [
        carried(mended, flat, calibration, slice(a, b), (b - a) // 2) if has_rates else mended.acc[a:b]
        for a, b in runs.tolist()
    ]
    rests = _Rests(mended, runs, readings, calibration, float(np.nanmean(T)) if known else None)
    turns = (_direction(rests, k, flat, calibration) for k in range(1, len(runs) if has_rates else 1))
    parts = [_magnitudes(rests, gravity), *(turn for turn in turns if turn is not None)]
    first = recording.gyr[slice(*runs[0])]
    # A calibration without b_omega (from an old calibration.bin) has no residual of the rate.
    rate = first.mean(0) - calibration.b_omega
    parts.append(_of_theta(DELTA, rate, flat.Sigma_omega / len(first) + BIAS_RAD_S**2, rests))
    noise = _noise_ratios(recording, flat, calibration)
    parts.append(_of_theta(NOISE, noise, np.full(2, 1.0 / (6.0 * LEAST_INDEPENDENT * flat.n)), rests))
    J_rests = np.vstack([part.J_rests for part in parts])
    J = np.vstack([part.J_theta for part in parts])
    J[:, : BETA.stop] += J_rests @ np.vstack([accelerometer_jacobian(a) for a in rests.a])
    R = J_rests @ rests.covariance @ J_rests.T + np.diag(np.concatenate([part.variance for part in parts]))
    r, seconds = np.concatenate([part.r for part in parts]), float(recording.t[-1] - recording.t[0])
    return Observations(r, J, R, -rests.unit, rests.temperature_c, seconds)


class _Rests:
    """Calibrated means `a` (k, 3) of the rests, their unit vectors and norms, and the covariance (3 k, 3 k) of `a`."""

    def __init__(
        self,
        recording: Recording,
        runs: Intervals,
        readings: Sequence[Vector],
        calibration: Calibration,
        temperature_c: float | None,
    ) -> None:
        self.recording, self.runs, self.temperature_c = recording, runs, temperature_c
        A = calibration.inverse
        means = [acc.mean(0) for acc in readings]
        self.a = calibration.apply(np.array(means), temperature_c=temperature_c)
        self.norm = np.linalg.norm(self.a, axis=1)
        self.unit = self.a / self.norm[:, None]
        shortest = max(round(BLOCK_S * recording.rate_hz), 1)
        sizes = np.maximum((runs[:, 1] - runs[:, 0]) // BLOCKS_A_REST, shortest).tolist()
        own = [block_means(acc, n) for acc, n in zip(readings, sizes, strict=True)]
        counts = np.array([len(block) for block in own])
        variances = np.array([block.var(0, ddof=1).mean() for block in own])
        others = variances[1:].mean() if len(runs) > 1 else variances[0]
        pooled = ((counts - 1) * 3 * variances + POOLED_FREEDOM * others) / ((counts - 1) * 3 + POOLED_FREEDOM)
        self.covariance = np.zeros((3 * len(runs), 3 * len(runs)))
        for k, variance in enumerate(pooled / counts):
            self.covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = variance * A @ A.T


class _Residuals(NamedTuple):
    """Residuals r (q,), their derivatives J_rests (q, 3 k) by the k rests' means and J_theta (q, 23).

    variance : (q,) in addition to what follows from the means.
    """

    r: Vector
    J_rests: Vector
    J_theta: Vector
    variance: Vector


def _magnitudes(rests: _Rests, gravity: float) -> _Residuals:
    """Return |a| - g of each rest."""
    k = len(rests.a)
    J_rests = np.zeros((k, k, 3))
    J_rests[range(k), range(k)] = rests.unit
    nothing = np.zeros((k, PARAMETERS))
    return _Residuals(rests.norm - gravity, J_rests.reshape(k, 3 * k), nothing, np.full(k, FLOOR_MPS2**2))


def _direction(rests: _Rests, k: int, flat: Flat, calibration: Calibration) -> _Residuals | None:
    """Return the direction error of the turn to rest k; None if a rate was clipped, or samples are missing."""
    recording = rests.recording
    first, last = (rests.runs[k - 1 : k + 1].sum(1) // 2).tolist()
    between = slice(first, last + 1)
    if recording.gyr_clipped[between].any() or recording.gap[first + 1 : last + 1].any():
        return None
    dt, rates, noise = turn_between(recording, flat, first, last)
    steps = dt[:, None] * (rates @ calibration.K.T)
    (T,), (of_turn,) = turn_by_matrix(steps, np.eye(3), np.array([[0, len(steps)]]))
    here, there = rests.unit[k], T @ rests.unit[k - 1]
    across = np.linalg.svd(here[None])[2][1:]  # (2, 3) unit vectors at right angles to gravity
    J_rests = np.zeros((2, rests.a.size))
    for at, matrix in ((k - 1, -cross(here) @ T), (k, cross(there))):
        unit = rests.unit[at]
        of_unit = (np.eye(3) - np.outer(unit, unit)) / rests.norm[at]
        J_rests[:, 3 * at : 3 * at + 3] = across @ matrix @ of_unit
    J_theta = np.zeros((2, PARAMETERS))
    J_theta[:, G] = -across @ cross(here) @ cross(here) @ of_turn
    noise += FLOOR_RAD**2 + (TURN_NONLINEARITY * float(np.linalg.norm(steps, axis=1).sum())) ** 2
    return _Residuals(across @ np.cross(there, here), J_rests, J_theta, np.full(2, noise))


def _of_theta(place: slice, r: Vector, variance: Vector, rests: _Rests) -> _Residuals:
    """Return residuals that are elements of theta themselves plus noise; unknown ones (NaN) are left out."""
    known = np.isfinite(r)
    return _Residuals(
        r[known], np.zeros((known.sum(), rests.a.size)), np.eye(PARAMETERS)[place][known], variance[known]
    )


def _noise_ratios(recording: Recording, flat: Flat, calibration: Calibration) -> Vector:
    """Return the logarithms (2,) of both sensors' noise, relative to the calibration's, as far as they are known."""
    # At a different rate the bandwidth is different too, and with it the noise.
    same_rate = calibration.sensor.rate_hz == recording.sensor.rate_hz is not None
    ratios = np.full(2, np.nan)
    pairs = (recording.acc, calibration.noise_std), (recording.gyr, calibration.gyro_noise_std)
    for k, (values, then) in enumerate(pairs):
        now = values[flat.first : flat.last]
        if same_rate and not _is_shaken(now, recording.rate_hz):
            ratios[k] = float(np.log(now.std(0) / then).mean())
    return ratios


def _is_shaken(values: Vector, rate_hz: float) -> bool:
    """Return True if means over 0.1 s of values (n, 3) vary by more than noise does."""
    n = max(round(SHAKEN_S * rate_hz), 1)
    blocks = block_means(values, n)
    return bool((n * blocks.var(0) > MOST_SHAKEN_RATIO * values.var(0)).any())


def accelerometer_jacobian(a: Vector) -> Vector:
    """Return the derivatives (3, 12) of E s + beta by the 12 numbers E (row-major) and beta, at s = a."""
    return np.hstack([np.kron(np.eye(3), a), np.eye(3)])
