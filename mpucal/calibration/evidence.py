"""The facts that a verdict rests on, each computed once. Knows no verdict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from .information import Uncertainty, uncertainty
from .model import Fit, Flat, product, rotation
from .stationary import find_flat
from .still import still_runs

HALF_SECOND = 0.5
LONGEST_MOVE_S = 20.0  # over which a gyroscope still says where gravity went


class Rests(NamedTuple):
    """How well the calibrated rests agree with gravity and, by the gyroscope, with each other.

    magnitude_rms : m/s^2, of |a| - g. miss_median, miss_max : rad, of gravity carried from rest to rest; NaN where
        no two rests are near enough in time.
    """

    number: int
    magnitude_rms: float
    miss_median: float
    miss_max: float


@dataclass(frozen=True)
class Evidence:
    """A recording and what an estimator made of it; flat and fit are None where it did not get so far."""

    recording: Recording
    gravity: float
    flat: Flat | None
    fit: Fit | None
    model: str

    @cached_property
    def sure(self) -> Uncertainty | None:
        """What the covariance means for a measurement; None where there is no usable D."""
        fit = self.fit
        if fit is None or not np.isfinite(fit.covariance).all() or not np.isfinite(fit.D).all():
            return None
        if abs(np.linalg.det(fit.D)) < 1e-6:
            return None
        return uncertainty(fit.D, fit.covariance[:12, :12], self.gravity)

    @cached_property
    def calibrated(self) -> Vector | None:
        """(n, 3) m/s^2, every sample by equation (4)."""
        if self.fit is None or self.sure is None:
            return None
        return np.asarray((self.recording.acc - self.fit.b_a) @ np.linalg.inv(self.fit.D).T)

    @cached_property
    def means(self) -> Vector:
        """(m, 3) m/s^2, means of the half seconds after the flat segment (of all, where there is none)."""
        first = 0 if self.flat is None else self.flat.last
        n = max(round(HALF_SECOND * self.recording.rate_hz), 1)
        acc = self.recording.acc[first:]
        m = len(acc) // n
        return np.asarray(acc[: m * n].reshape(m, n, 3).mean(1))

    @cached_property
    def gravity_moved(self) -> float:
        """rad, the largest angle between the flat mean and a half-second mean after it."""
        if self.flat is None or len(self.means) == 0:
            return 0.0
        u = _units(self.means)
        return float(np.arccos(np.clip((u @ _units(self.flat.y[None])[0]).min(), -1.0, 1.0)))

    @cached_property
    def gyro_turned(self) -> float:
        """What the gyroscope has turned in all after the flat segment, in its unit of angle."""
        if self.flat is None:
            return 0.0
        rate = np.linalg.norm(self.recording.gyr[self.flat.last :] - self.flat.b_omega, axis=1)
        return float(np.sum(rate[1:] * np.diff(self.recording.t[self.flat.last :])))

    @cached_property
    def gravity_turned(self) -> float:
        """rad that gravity's direction has turned in all, from half second to half second; at least a tenth."""
        u = _units(self.means)
        angles = np.arccos(np.clip(np.sum(u[1:] * u[:-1], axis=1), -1.0, 1.0))
        return max(float(angles[angles > np.deg2rad(2.0)].sum()), 0.1)

    @cached_property
    def still_in_degrees(self) -> bool:
        """Whether a recording that never lies still would, were its rates in deg/s."""
        r = self.recording
        small = Recording.from_arrays(r.t, r.acc, np.deg2rad(r.gyr))
        return self.flat is None and find_flat(small) is not None

    @cached_property
    def rests(self) -> Rests | None:
        """The rests, three or more, under the fit."""
        fit, flat, r = self.fit, self.flat, self.recording
        if fit is None or flat is None or self.calibrated is None:
            return None
        runs = still_runs(r, flat)
        if len(runs) < 3:
            return None
        poses = np.array([self.calibrated[a:b].mean(0) for a, b in runs])
        bias = np.array([r.gyr[a:b].mean(0) for a, b in runs])
        misses = []
        for k in range(len(runs) - 1):
            a, b = runs[k][1] - 1, runs[k + 1][0]
            if r.t[b] - r.t[a] > LONGEST_MOVE_S:
                continue
            rate = r.gyr[a:b] - 0.5 * (bias[k] + bias[k + 1])
            carried = product(rotation(-np.diff(r.t[a : b + 1])[:, None] * (rate @ fit.K.T))) @ poses[k]
            cosine = _units(carried[None])[0] @ _units(poses[k + 1][None])[0]
            misses.append(float(np.arccos(np.clip(cosine, -1.0, 1.0))))
        magnitude = np.linalg.norm(poses, axis=1) - self.gravity
        return Rests(len(runs), float(np.sqrt(np.mean(magnitude**2))), *_median_and_max(misses))


def _median_and_max(values: list[float]) -> tuple[float, float]:
    return (float(np.median(values)), max(values)) if values else (np.nan, np.nan)


def _units(v: Vector) -> Vector:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9))
