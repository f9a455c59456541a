"""The segment in which the board lies flat: where it is, and its means and variances (line 1 of Algorithm 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Sensor, Vector
from .local_noise import VIBRATION, noise_variance

WINDOW_S = 0.5
SHORTEST_FLAT_S = 1.0
SHORTEST_GIVEN_S = 0.25  # of a shorter one the block means that a fit starts from have no variance
ENOUGH_FLAT_S = 5.0

# Above these a window is not still, however noisy the quietest part of a recording is ...
GYRO_SD_MAX_RAD_S, ACC_SD_MAX_MPS2 = 0.15, 0.5
# ... and below these it may be, however quiet: a table that hums, a hand that is braced.
GYRO_SD_MIN_RAD_S, ACC_SD_MIN_MPS2 = 0.03, 0.15
# Neighbouring windows of a still board agree this well beyond their noise.
GYRO_STEP_RAD_S, ACC_STEP_MPS2 = 0.01, 0.03

# In steps^2: at rest, less variance than that leaves the readings on one step or two, which no mean makes finer.
UNVARIED, UNIFORM = 0.3, 1.0 / 12.0

# No sensor of this kind is quieter; data without noise are simulated, or stuck.
QUIETEST_ACC_MPS2, QUIETEST_GYRO_RAD_S = 1e-4, 1e-5


@dataclass(frozen=True)
class Flat:
    """Line 1 of Algorithm 1: what the flat segment says.

    Attributes
    ----------
    first, last : samples first..last-1 are the segment.
    y : (3,) m/s^2, mean of the accelerometer. b_omega : (3,) rad/s, mean of the gyroscope.
    Sigma_a : (3,) (m/s^2)^2 and Sigma_omega : (3,) (rad/s)^2, the diagonals of the covariances.
    rounded : (m/s^2)^2 of y by coarse steps of the stream, which no number of samples makes less.
    """

    first: int
    last: int
    y: Vector
    b_omega: Vector
    Sigma_a: Vector
    Sigma_omega: Vector
    rounded: float = 0.0

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.last - self.first

    @property
    def worth(self) -> float:
        """How many samples of independent noise y is worth."""
        return min(self.n, float(self.Sigma_a.min()) / self.rounded) if self.rounded else self.n


def find_flat(recording: Recording) -> tuple[int, int] | None:
    """(first, last + 1) of the segment that lies flat, or None where the board never lies still.

    It is the earliest still run of five seconds, or else of half the length of the longest. A run is still where the
    windows' spread is small, or is vibration alone, and their means agree: a turn at a constant rate has no variance,
    only a mean that moves.
    """
    n = max(round(WINDOW_S * recording.rate_hz), 4)
    acc, gyr = _windows(recording.acc, n), _windows(recording.gyr, n)
    if len(acc) < 2:
        return None
    acc_mean, gyr_mean = acc.mean(1), gyr.mean(1)
    acc_sd, gyr_sd = acc.std(1), gyr.std(1)
    vibration2 = VIBRATION * _windows(noise_variance(recording), n).mean(1)
    quiet = ((acc_sd <= _limit(acc_sd, ACC_SD_MIN_MPS2, ACC_SD_MAX_MPS2)) | (acc_sd**2 <= vibration2)).all(1)
    quiet &= (gyr_sd <= _limit(gyr_sd, GYRO_SD_MIN_RAD_S, GYRO_SD_MAX_RAD_S)).all(1)
    whole = ~(_windows(recording.gap[:, None], n)[:, 1:, 0].any(1))
    quiet &= whole
    runs = []
    start = 0
    for k in range(1, len(acc) + 1):
        if k < len(acc) and quiet[k - 1] and quiet[k] and not recording.gap[k * n]:
            here = slice(start, k)
            size = 4.5 * np.sqrt(1.0 / n + 1.0 / (n * (k - start)))
            near_acc = np.abs(acc_mean[k] - acc_mean[here].mean(0)) <= ACC_STEP_MPS2 + size * acc_sd[here].mean(0)
            near_gyr = np.abs(gyr_mean[k] - gyr_mean[here].mean(0)) <= GYRO_STEP_RAD_S + size * gyr_sd[here].mean(0)
            if near_acc.all() and near_gyr.all():
                continue
        if quiet[k - 1] and k - start >= 2:
            runs.append((start * n, k * n))
        start = k
    shortest = SHORTEST_FLAT_S * recording.rate_hz
    runs = [run for run in runs if run[1] - run[0] >= shortest]
    if not runs:
        return None
    longest = max(last - first for first, last in runs)
    enough = min(longest / 2, ENOUGH_FLAT_S * recording.rate_hz)
    first, last = next(run for run in runs if run[1] - run[0] >= enough)
    # the outermost windows may hold the first and last of a movement
    trim = n if last - first >= 6 * n else 0
    return first + trim, last - trim


def tells(recording: Recording, flat: tuple[int, int]) -> bool:
    """Whether a flat segment, given by a caller, is long enough to tell noise and bias."""
    return flat[1] - flat[0] >= max(round(SHORTEST_GIVEN_S * recording.rate_hz), 2)


def flat_statistics(recording: Recording, flat: tuple[int, int]) -> Flat:
    """Sigma_a, Sigma_omega, b_omega and the mean acceleration of samples flat[0]..flat[1]-1 (Algorithm 1, line 1).

    A variance is never zero: a stream of coarse steps may read exactly constant, but its noise is then somewhere
    below a step, not absent. Nor is it below what the recording's source knows to be least.
    """
    first, last = flat
    least_acc, least_gyr = recording.sensor.least_noise
    acc, gyr = recording.acc[first:last], recording.gyr[first:last]
    return Flat(
        first,
        last,
        y=acc.mean(0),
        b_omega=gyr.mean(0),
        Sigma_a=_variance(acc, recording.acc, max(least_acc, QUIETEST_ACC_MPS2)),
        Sigma_omega=_variance(gyr, recording.gyr, max(least_gyr, QUIETEST_GYRO_RAD_S)),
        rounded=rounding_variance(recording.sensor, acc.var(0)),
    )


def rounding_variance(sensor: Sensor, variance: Vector) -> float:
    """(m/s^2)^2 of a mean acceleration at rest, however long: of readings in coarse steps, whose variance is (3,)."""
    step = sensor.steps[0]
    return UNIFORM * step**2 if (variance < UNVARIED * step**2).any() else 0.0


def _windows(values: NDArray[Any], n: int) -> NDArray[Any]:
    """(m, n, 3) consecutive windows of n samples; the remainder is left out."""
    m = len(values) // n
    return values[: m * n].reshape(m, n, values.shape[1])


def _limit(sd: Vector, least: float, most: float) -> Vector:
    """(3,) the largest standard deviation that still counts as quiet."""
    return np.clip(2.5 * np.quantile(sd, 0.05, axis=0), least, most)


def _variance(part: Vector, whole: Vector, quietest: float) -> Vector:
    step = np.array([_step(column) for column in whole.T])
    away = part - part.mean(0)
    variance = np.einsum("ij,ij->j", away, away) / (len(part) - 1)
    return np.asarray(np.maximum(variance, np.maximum(step**2 / 12.0, quietest**2)))


def _step(column: Vector) -> float:
    """The stream's resolution: its smallest difference between two values, 0 where it is as fine as noise.

    A thousand samples tell: where nearly all values differ there are no steps to see.
    """
    values = np.unique(column[:: max(len(column) // 1000, 1)])
    if len(values) < 2:
        return 0.0
    return float(np.min(np.diff(values))) if len(values) < 700 else 0.0
