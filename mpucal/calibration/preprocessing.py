"""Preprocessing of a recording for the hand's model: its rests, rates for the lever arm, and the hand's noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..data import Recording, Vector
from ..kernel import _kernel
from ..rests.flat import UNAVERAGED, Flat, flat_statistics, left_by_rounding
from ..rests.gyro_drift import remove_drift
from ..rests.intervals import Intervals, RestFinder, statistics
from ..rests.limits import MOVING_RAD_S
from ..rests.tremor import SWAY_PER_S, without_tremor
from ..rests.windows import WINDOW_S, noise_ratio, noise_variance
from .masks import SMOOTH_S, mask
from .poses import POSE_MPS2, Poses
from .problem import Problem, Series
from .rotation import lengths
from .theta import Prior

HUBER = 2.0
SHAKEN_MPS2 = 0.3  # standard deviation of |y| in a window that does the same, at any rate: walking shakes the board
CORRELATION_S = 0.2  # of the acceleration of a hand that goes from rest to rest
FLOOR_CORRELATION_S = 0.05  # of jerks
FLOOR_MPS2 = 0.12  # white acceleration by jerks, in addition to the pivot's own
MANY_RESTS = 6


@dataclass(frozen=True)
class Preprocessed:
    """Recording after its flat segment, with the components of its noise.

    Attributes
    ----------
    recording, flat : with the gyroscope's drift and the tremor of the rests removed.
    problem : the series with the sway of the rests, and no noise of moving yet.
    runs : (k, 2) rests in samples of the recording. rests : number of those that end after the flat segment.
    motion : (n,) 0 at rest to 1. pose : (n,) (m/s^2)^2, r_extra of the rests.
    """

    recording: Recording
    flat: Flat
    problem: Problem
    runs: Intervals
    rests: int
    motion: Vector
    pose: Vector

    @property
    def rests_often(self) -> bool:
        """True if the rests alone suffice for an estimate."""
        return self.rests >= MANY_RESTS

    def prior(self, **more: tuple[Vector | float, Vector | float]) -> Prior:
        """Return the prior of the sensor, with `more` rows, as for Prior.of."""
        return Prior.of_sensor(self.flat, self.recording.sensor, **more)

    def white(self, sigma: float, correlation_s: float = 0.0) -> Problem:
        """Return the problem with white acceleration of sigma [m/s^2] in motion, (1 + 2 correlation_s / dt) times."""
        longer = 1.0 + 2.0 * correlation_s / self._dt
        return self._with(r_extra=self.pose + longer * sigma**2 * self.motion)

    def pivot(self, sigma: float, floor: float = 0.0, lam: float | None = None) -> Problem:
        """Return the problem with a pivot whose bounded travel accelerates the board by sigma [m/s^2] in motion.

        floor : m/s^2, white noise in addition. lam : 1/s, the poles of the travel, if not the problem's own.
        """
        lam = lam or self.problem.lam
        jerk = jerk_density(sigma, lam) * self.motion
        if self.problem.series.jerk is not None:
            jerk = jerk + lam / self.problem.lam * self.problem.series.jerk  # which keeps the size of the sway
        white = 2.0 * FLOOR_CORRELATION_S / self._dt * floor**2 * self.motion
        return replace(self._with(jerk=jerk, r_extra=self.pose + white), lam=lam)

    def vibrating(self, sigma: float) -> Preprocessed:
        """Return the recording with a vibration of sigma [m/s^2] on every axis."""
        return replace(self, pose=self.pose + sigma**2)

    def with_rates_by(self, K: Vector) -> Preprocessed:
        """Return the recording with the rates and angular accelerations of the lever arm corrected by K (3, 3)."""
        series = self.problem.series
        assert series.rate is not None and series.alpha is not None
        return replace(self, problem=self._with(rate=series.rate @ K.T, alpha=series.alpha @ K.T))

    @cached_property
    def poses(self) -> Poses:
        """Poses of the rests that end after the flat segment."""
        runs = self.runs[self.runs[:, 1] > self.flat.last + 1]
        return Poses.of(self.recording, self.flat, self.problem, runs)

    @cached_property
    def _dt(self) -> float:
        return float(np.median(self.problem.series.dt))

    def _with(self, **series: Vector) -> Problem:
        return replace(self.problem, series=replace(self.problem.series, **series))


def preprocess(recording: Recording, at: tuple[int, int], gravity: float) -> Preprocessed:
    """Prepare a recording whose flat segment is at[0]..at[1]-1."""
    recording, runs = find_rests(recording, flat_statistics(recording, at))
    return prepare(recording, at, runs, gravity)


def find_rests(recording: Recording, flat: Flat) -> tuple[Recording, Intervals]:
    """Return the recording without the gyroscope's drift, and its rests."""
    rests = RestFinder(recording, flat)
    runs = rests.typical()
    return remove_drift(recording, flat, rests.bias_runs(runs)), runs


def prepare(
    recording: Recording, at: tuple[int, int], runs: Intervals, gravity: float, noise: Vector | None = None
) -> Preprocessed:
    """Prepare a recording without drift, whose flat segment is at[0]..at[1]-1 and whose rests are `runs` (k, 2).

    noise : (n,) factors of Sigma_a, known from before the downsampling of a recording.
    """
    flat = flat_statistics(recording, at)
    loud = (noise_ratio(recording, flat.Sigma_a) if noise is None else noise)[flat.last :]
    series = mask(Series.after(recording, flat), recording, flat)
    series = replace(series, r_scale=loud if series.r_scale is None else np.maximum(series.r_scale, loud))
    after = np.maximum(runs[runs[:, 1] > flat.last] - flat.last, 0)
    rest = np.zeros(len(series), bool)
    for a, b in after:
        rest[a:b] = True
    # At rest, rates are noise alone, and noise in a regressor biases the lever arm towards zero.
    rate, alpha = (np.where(rest[:, None], 0.0, values) for values in smoothed_rates(recording, flat))
    if recording.sensor.time_std:
        # A turn errs by its angular acceleration times the error of its times.
        of_times = 2.0 * CORRELATION_S * recording.sensor.time_std**2 * np.sum(alpha * alpha, axis=1) * series.dt
        series = replace(series, q_extra=of_times if series.q_extra is None else series.q_extra + of_times)
    speed2 = np.sum(rate * rate, axis=1)
    noise_factor = np.array([loud[a:b].mean() for a, b in after])
    hand = without_tremor(recording, flat, after + flat.last, noise_factor)
    rounded = left_by_rounding(*statistics(recording.acc[flat.last :], after), recording.sensor.steps[0], UNAVERAGED)
    reset, jerk, pose = np.full(len(series), -1.0), np.zeros(len(series)), np.zeros(len(series))
    of_rests = zip(after.tolist(), np.sqrt(hand.sway).tolist(), hand.jitter.tolist(), rounded, strict=True)
    for (a, b), sway, jitter, rounding in of_rests:
        reset[a], jerk[a:b] = sway, jerk_density(sway, SWAY_PER_S)
        pose[a:b] = (POSE_MPS2**2 + jitter + rounding.max()) * (b - a)
        if b < len(series):
            reset[b] = 0.0
    recording = replace(recording, acc=hand.acc)
    series = replace(series, y=hand.acc[flat.last :], rate=rate, alpha=alpha, reset=reset, jerk=jerk, r_extra=pose)
    problem = Problem(series, flat, gravity, huber=HUBER, tail=1.0, lam=SWAY_PER_S)
    # With many rests, all between them is motion: the ends of a move are slow, but in the hand, too.
    if len(after) >= MANY_RESTS:
        motion = np.where(rest, 0.0, 1.0)
    else:
        motion = np.maximum(speed2 / (speed2 + MOVING_RAD_S**2), _shaken(recording, flat))
    return Preprocessed(recording, flat, problem, runs, len(after), motion, pose)


def jerk_density(sigma: float, lam: float) -> float:
    """Return the spectral density of the jerk [(m/s^3)^2/Hz] for an acceleration of sigma [m/s^2] rms.

    The position's three poles at lam leave the acceleration a variance of 3 q / (16 lam).
    """
    return 16.0 * lam / 3.0 * sigma**2


def smoothed_rates(recording: Recording, flat: Flat) -> tuple[Vector, Vector]:
    """Return rate and angular acceleration (n, 3) after the flat segment, for the acceleration by a lever arm.

    Noise of the angular acceleration biases the lever arm: towards zero by as much as it adds to its square, and away
    from zero by half of what smoothing takes from that. The rates are smoothed over more than SMOOTH_S as long as that
    makes the sum of both less: in a machine, which turns steadily.
    """
    measured, shortest = recording.gyr - flat.b_omega, int(SMOOTH_S * recording.rate_hz)
    # The times are smoothed as the rates are, since a computer's times jitter.
    times = _kernel.moving_mean((recording.t - recording.t[0])[:, None], shortest)[:, 0]

    def smoothed(x: Vector, half: int) -> Vector:
        once = _kernel.moving_mean(x, half)
        # Twicing (J. W. Tukey) keeps the curvature that a mean over a long window loses.
        return once if half == shortest else 2.0 * once - _kernel.moving_mean(once, half)

    least, rate, half = np.inf, measured, shortest
    while half < len(measured):
        impulse = np.zeros((8 * half + 9, 1))
        impulse[4 * half + 4] = 1.0
        wider = smoothed(measured, half)
        squares, of_noise = (np.sum(step**2) for step in (_steps(wider[flat.last :]), _steps(smoothed(impulse, half))))
        of_noise *= flat.Sigma_omega.sum()
        bias = of_noise - 0.5 * (squares / (len(wider) - flat.last) - of_noise)
        if not bias < least:
            break
        least, rate, half = bias, wider, 2 * half + 1
    return rate[flat.last :], np.gradient(rate, times, axis=0)[flat.last :]


def _steps(x: Vector) -> Vector:
    """Return differences over two samples, times which the rate is the angular acceleration."""
    return np.asarray(x[2:] - x[:-2])


def _shaken(recording: Recording, flat: Flat) -> Vector:
    """Return (n,) 0 to 1 after the flat segment, by the variation of |y| within half a second, which no turn causes."""
    size = lengths(recording.acc)
    away = size - size.mean()
    half = max(round(0.5 * WINDOW_S * recording.rate_hz), 2)
    mean, square = _kernel.moving_mean(np.stack([away, away**2], axis=1), half).T
    variance = np.maximum(square - mean**2 - 1.3 * noise_variance(recording) @ np.full(3, 1.0 / 3.0), 0.0)[flat.last :]
    return np.asarray(variance / (variance + SHAKEN_MPS2**2))
