"""Flat segment, in which the board lies still: its place, means and variances (line 1 of Algorithm 1)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..clocks import UNIFORM
from ..data import Recording, Vector
from ..kernel import _kernel
from .limits import QUIET
from .stillness import Detector, still_windows
from .windows import WINDOW_S, CutWindows

FEWEST = 4  # samples of a window, which is longer than WINDOW_S below 8 Hz
SHORTEST_FLAT_S = 1.0
SHORTEST_GIVEN_S = 0.25  # of a segment that a caller names: a shorter one has too few block means for a variance
ENOUGH_FLAT_S = 5.0
LONG = 6  # so many windows of a flat segment are enough to leave out its first and its last one in any case

# With less variance at rest than this [steps^2], the readings stay on one step or two, and no mean makes them finer.
UNVARIED = 0.3
VISIBLE = 699  # if a thousand sorted values differ in fewer places, the readings are coarse and show their step
# Share of the variance of rounding that remains in the mean of a short rest in a hand: behind an autopilot's low-pass
# filter, noise and tremor cross few steps. From simulated vehicles with filters of 5 and 20 Hz.
UNAVERAGED = 0.15

# No sensor of this kind has less noise; data without noise are simulated, or stuck.
QUIETEST_ACC_MPS2, QUIETEST_GYRO_RAD_S = 1e-4, 1e-5


@dataclass(frozen=True)
class Flat:
    """Statistics of the flat segment, line 1 of Algorithm 1.

    Attributes
    ----------
    first, last : samples first..last-1 are the segment.
    y : (3,) m/s^2, mean of the accelerometer. b_omega : (3,) rad/s, mean of the gyroscope.
    Sigma_a : (3,) (m/s^2)^2 and Sigma_omega : (3,) (rad/s)^2, the diagonals of the covariances.
    rounded : (m/s^2)^2, and rounded_rates : (3,) (rad/s)^2, variances of y and b_omega by coarse steps of the readings,
        which more samples do not reduce.
    """

    first: int
    last: int
    y: Vector
    b_omega: Vector
    Sigma_a: Vector
    Sigma_omega: Vector
    rounded: float = 0.0
    rounded_rates: Vector | float = 0.0

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.last - self.first

    @property
    def worth(self) -> float:
        """Number of samples that would give y the same variance without rounding."""
        return min(self.n, float(self.Sigma_a.min()) / self.rounded) if self.rounded else self.n

    @property
    def b_omega_std(self) -> Vector:
        """Standard deviations (3,) of b_omega [rad/s]."""
        return np.asarray(np.sqrt(self.Sigma_omega / self.n + self.rounded_rates))


def find_flat(recording: Recording) -> tuple[int, int] | None:
    """Return (first, last + 1) of the flat segment, or None where the board never lies still.

    It is the earliest still run of five seconds, or else of half the length of the longest. Stillness is that of a
    session on a table, except that the gyroscope's bias may have any size and that a bump ends a run.
    """
    n = samples_of_window(recording)
    windows = CutWindows.of(with_rates(recording), n)
    if len(windows) < 2:
        return None
    detector = Detector(QUIET, tuple(np.quantile([windows.acc_sd, windows.gyr_sd], 0.05, axis=1)), math.inf)
    runs: list[tuple[int, int, int]] = []
    for run, first, last in still_windows(detector, windows):
        goes_on = runs and runs[-1][0] == run and runs[-1][2] == first
        if len(runs) == 1 and not goes_on and runs[0][2] - runs[0][1] >= ENOUGH_FLAT_S * recording.rate_hz:
            break  # the first one is long enough, whatever follows
        runs.append((run, runs.pop()[1] if goes_on else first, last))
    lengths = [last - first for _, first, last in runs]
    if max(lengths, default=0) < SHORTEST_FLAT_S * recording.rate_hz:
        return None
    enough = max(min(max(lengths) / 2, ENOUGH_FLAT_S * recording.rate_hz), SHORTEST_FLAT_S * recording.rate_hz)
    _, first, last = next(run for run, length in zip(runs, lengths, strict=True) if length >= enough)
    # The first and the last window may hold the end of one movement and the beginning of the next, and are left out. In
    # a short segment they are left out only if they vary more than all others.
    level = detector.shares(windows).level[first // n : last // n].tolist()
    if len(level) >= 4:
        most = max(level[1:-1]) if len(level) < LONG else -1.0
        first, last = first + n * (level[0] > most), last - n * (level[-1] > most)
    return first, last


def with_rates(recording: Recording) -> Recording:
    """Return the recording with rates of zero where it has none, so that the accelerometer alone detects rests."""
    known = np.isfinite(recording.gyr)
    return recording if known.all() else replace(recording, gyr=np.where(known, recording.gyr, 0.0))


def samples_of_window(recording: Recording) -> int:
    """Return the number of samples of a window for the detection of stillness."""
    return max(round(WINDOW_S * recording.rate_hz), FEWEST)


def is_long_enough(recording: Recording, flat: tuple[int, int]) -> bool:
    """Return True if a flat segment, given by a caller, is long enough for noise and bias."""
    return flat[1] - flat[0] >= max(round(SHORTEST_GIVEN_S * recording.rate_hz), 2)


def flat_statistics(recording: Recording, flat: tuple[int, int]) -> Flat:
    """Compute the statistics of samples flat[0]..flat[1]-1 (Algorithm 1, line 1).

    A variance is never zero: a stream of coarse steps may be constant, but its noise is then somewhere below a step,
    not absent. Nor is it below the least noise that the recording's source knows.
    """
    first, last = flat
    recording = with_rates(recording)
    least_acc, least_gyr = recording.sensor.least_noise
    y, spread_a, Sigma_a = _statistics(recording.acc, flat, max(least_acc, QUIETEST_ACC_MPS2))
    b_omega, spread_omega, Sigma_omega = _statistics(recording.gyr, flat, max(least_gyr, QUIETEST_GYRO_RAD_S))
    acc_step, gyr_step = recording.sensor.steps
    rounded = float(left_by_rounding(y, spread_a, acc_step).max())
    rounded_rates = left_by_rounding(b_omega, spread_omega, gyr_step)
    return Flat(first, last, y, b_omega, Sigma_a, Sigma_omega, rounded, rounded_rates)


def left_by_rounding(mean: Vector, variance: Vector, step: float, least: float = 0.0) -> Vector:
    """Return the variance (..., 3) that coarse steps leave in means at rest of readings with `variance` (..., 3).

    least : share of the variance of rounding that is left where the readings vary.
    """
    return np.asarray(np.where(variance < UNVARIED * step**2, rounding(mean, step), least * UNIFORM * step**2))


def rounding(readings: Vector, step: float) -> Vector:
    """Return the variance by rounding for each reading, in the square of its unit.

    A stream that truncates makes the step around zero twice as wide as the others.
    """
    return np.where(np.abs(readings) < step, 4.0, 1.0) * (UNIFORM * step**2)


def _statistics(values: Vector, flat: tuple[int, int], quietest: float) -> tuple[Vector, Vector, Vector]:
    """Return (3,) the mean of the segment, the variance of its samples, and the least variance of the noise."""
    mean, variance = _kernel.statistics(np.ascontiguousarray(values), np.array([flat], np.int64))
    n, least = flat[1] - flat[0], np.maximum(UNIFORM * _steps(values) ** 2, quietest**2)
    return mean[0], variance[0], np.maximum(variance[0] * n / (n - 1), least)


def _steps(values: Vector) -> Vector:
    """Return (3,) the steps of the readings, the smallest difference of two values; 0 where they are finer than noise.

    A thousand samples are enough: if nearly all of them differ, no step is visible.
    """
    steps = np.diff(np.sort(values[:: max(len(values) // 1000, 1)].T))
    rising = [of[of > 0.0] for of in steps]
    return np.array([of.min() if 0 < len(of) < VISIBLE else 0.0 for of in rising])
