"""The facts that a verdict rests on, each computed once: uncertainties, pauses, how gravity turned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from ..reasons import Reason
from ..rests.flat import Flat, find_flat, flat_statistics
from ..rests.intervals import RestFinder, in_pieces, statistics
from .claim import Claim
from .fit import Fit
from .rotation import lengths, turned
from .sphere import fibonacci_sphere
from .tilt import tilted_directions
from .uncertainty import DIRECTIONS, Uncertainty, uncertainty

HALF_SECOND = 0.5
LEAST_MOVE_RAD = np.deg2rad(2.0)  # of gravity in half a second, above noise
ENOUGH_MOVES = 100
LEAST_TURN_RAD = np.deg2rad(20.0)  # of gravity, beyond what biases and skew turn it by
OTHER_RANGES = (0.25, 0.5, 2.0, 4.0)
CLEARLY = 3.0  # times as far the one misses where another unit or range is meant
FAR_TOO_FAR = 20.0  # times as far as gravity: no rates in rad/s, but for turns about the vertical
MOST_MISS_RAD = np.deg2rad(7.5)  # of gravity from rest to rest; biases and skew of any sensor make it less
LONGEST_MOVE_S = 20.0  # over which a gyroscope still says where gravity went
# Rests that can contradict each other; of fewer, pieces so long do.
FEWEST_RESTS, PIECE_S = 3, 3.0


class Agreement(NamedTuple):
    """How well the calibrated static intervals agree with gravity and, by the gyroscope, with each other.

    magnitude_rms : m/s^2, of |a| - g. miss_median, miss_max : rad, of gravity carried from one to the next; NaN where
        no two are near enough in time.
    """

    number: int
    magnitude_rms: float
    miss_median: float
    miss_max: float


@dataclass(frozen=True)
class Evidence:
    """A recording and what an estimator made of it; flat and fit are None where it did not get so far.

    gravity_anyway : its caller stands by a gravity [m/s^2] that no place on Earth has.
    gyroscope : why the estimate is of the rests alone; None where it is not, or where that was asked for.
    """

    recording: Recording
    gravity: float
    flat: Flat | None
    fit: Fit | None
    model: str
    claim: Claim | None = None
    gravity_anyway: bool = False
    gyroscope: Reason | None = None

    @cached_property
    def sure(self) -> Uncertainty | None:
        """What the covariance means for a measurement; None where there is no usable D."""
        fit = self.fit
        if fit is None or not np.isfinite(fit.covariance).all() or not np.isfinite(fit.D).all():
            return None
        if abs(np.linalg.det(fit.D)) < 1e-6:
            return None
        sure = uncertainty(fit.D, fit.covariance[:12, :12], self.gravity, self._shown)
        return sure if sure.rms_mps2 > 0.0 else None  # the inverse of a singular H is no covariance

    @property
    def _shown(self) -> Vector | None:
        """(n, 3) the directions that the estimate is for; None: all."""
        if self.model != "tilt" or self.flat is None:
            return None
        return tilted_directions(self.flat.y / np.linalg.norm(self.flat.y), fibonacci_sphere(DIRECTIONS))

    @cached_property
    def calibrated(self) -> Vector | None:
        """(n, 3) m/s^2, every sample by equation (4)."""
        if self.fit is None or self.sure is None:
            return None
        return np.asarray((self.recording.acc - self.fit.b_a) @ np.linalg.inv(self.fit.D).T)

    @cached_property
    def gravity_moved(self) -> float:
        """rad, the largest angle between the flat mean and a half-second mean after it."""
        return 0.0 if self.flat is None else self._moved(self.recording.acc[self.flat.last :])

    @cached_property
    def gravity_moved_before(self) -> float:
        """Likewise before it."""
        return 0.0 if self.flat is None else self._moved(self.recording.acc[: self.flat.first])

    def _moved(self, acc: Vector) -> float:
        means = _means(acc, self._half_second)
        if self.flat is None or len(means) == 0:
            return 0.0
        return float(_angles(_units(means), _units(self.flat.y[None])).max())

    @property
    def _half_second(self) -> int:
        return max(round(HALF_SECOND * self.recording.rate_hz), 1)

    @cached_property
    def turned_in_degrees(self) -> bool:
        """Whether gravity turns from half second to half second as the rates say in deg/s, and not as in rad/s."""
        r, flat = self.recording, self.flat
        if flat is None:
            small = replace(r, gyr=np.deg2rad(r.gyr))
            segment = find_flat(small)
            if segment is None:
                return False
            flat = flat_statistics(r, segment)
        moves = self._half_seconds(flat)
        turns, angles = (sum(getattr(move, name) for move in moves) for name in ("turned", "angle"))
        return turns > FAR_TOO_FAR * angles > 0.0 and _miss(moves, 1.0) > CLEARLY * _miss(moves, np.deg2rad(1.0))

    def _half_seconds(self, flat: Flat) -> list[_Move]:
        """Moves between the middles of half seconds; as many of them tell as much as all."""
        n = self._half_second
        u = _units(_means(self.recording.acc[flat.last :], n))
        at = np.flatnonzero(_angles(u[1:], u[:-1]) > LEAST_MOVE_RAD)
        at = at[:: max(len(at) // ENOUGH_MOVES, 1)]
        middle = flat.last + n // 2
        return [self._move(flat, u[i], u[i + 1], middle + i * n, middle + (i + 1) * n) for i in at.tolist()]

    def _rest_to_rest(self, flat: Flat, longest_s: float = LONGEST_MOVE_S) -> list[_Move]:
        """Return the moves from rest to rest that turn gravity far and take no longer than `longest_s`."""
        r, runs = self.recording, RestFinder(self.recording, flat).typical()
        u, first, last = _units(statistics(r.acc, runs)[0]), runs[1:, 0], runs[:-1, 1]
        far = (_angles(u[1:], u[:-1]) > LEAST_TURN_RAD) & (r.t[first] - r.t[last - 1] < longest_s)
        return [self._move(flat, u[k], u[k + 1], last[k], first[k]) for k in np.flatnonzero(far).tolist()]

    @cached_property
    def gyro_factor(self) -> float:
        """By which power of two the rates are to be multiplied for gravity to turn as they say.

        From rest to rest; where there are few, from half second to half second.
        """
        if self.flat is None:
            return 1.0
        moves = self._rest_to_rest(self.flat)
        if len(moves) < FEWEST_RESTS:
            moves = self._half_seconds(self.flat)
        if len(moves) < FEWEST_RESTS:
            return 1.0
        factor = min((1.0, *OTHER_RANGES), key=lambda factor: _miss(moves, factor))
        miss = _miss(moves, factor)
        return factor if miss < MOST_MISS_RAD and _miss(moves, 1.0) > CLEARLY * miss else 1.0

    @cached_property
    def gyro_miss(self) -> float:
        """rad, median, from where the rates lead gravity to where it is at the next rest; 0 of too few rests."""
        moves = [] if self.flat is None else self._rest_to_rest(self.flat, np.inf)
        return _miss(moves, 1.0) if len(moves) >= FEWEST_RESTS else 0.0

    def _move(self, flat: Flat, before: Vector, after: Vector, first: int, last: int) -> _Move:
        """With the steps that end with the samples first to last - 1."""
        r = self.recording
        dt = r.t[first:last] - r.t[first - 1 : last - 1]
        return _Move(before, dt[:, None] * (r.gyr[first:last] - flat.b_omega), after)

    @cached_property
    def agreement(self) -> Agreement | None:
        """Of the static intervals, three or more, under the fit; of pieces of them, where they are fewer."""
        fit, flat, r = self.fit, self.flat, self.recording
        if fit is None or flat is None or self.calibrated is None:
            return None
        runs = RestFinder(r, flat).typical()
        if len(runs) < FEWEST_RESTS:
            runs = in_pieces(runs, round(PIECE_S * r.rate_hz))
        if len(runs) < FEWEST_RESTS:
            return None
        poses, bias = statistics(self.calibrated, runs)[0], statistics(r.gyr, runs)[0]
        misses = []
        for k in range(len(runs) - 1):
            a, b = runs[k][1] - 1, runs[k + 1][0]
            if r.t[b] - r.t[a] > LONGEST_MOVE_S or self.model == "static":
                continue
            dt, there = np.diff(r.t[a : b + 1])[:, None], _units(poses[k + 1][None])[0]
            # by the two rests' own rates, which know a drift, or by the estimate: a turn about the vertical looks still
            rates = [r.gyr[a:b] - b_omega for b_omega in (0.5 * (bias[k] + bias[k + 1]), fit.b_omega)]
            carried = [turned(-dt * (rate @ fit.K.T)) @ poses[k] for rate in rates]
            misses.append(float(np.arccos(np.clip(_units(np.array(carried)) @ there, -1.0, 1.0)).min()))
        magnitude = np.linalg.norm(poses, axis=1) - self.gravity
        return Agreement(len(runs), float(np.sqrt(np.mean(magnitude**2))), *_median_and_max(misses))


class _Move(NamedTuple):
    """Gravity's direction before (3,) and after (3,), and the turns (m, 3) rad between as the gyroscope says."""

    before: Vector
    turns: Vector
    after: Vector

    @property
    def angle(self) -> float:
        """rad from one to the other."""
        return float(_angles(self.before[None], self.after[None])[0])

    @property
    def turned(self) -> float:
        """rad, the sum of all turns."""
        return float(lengths(self.turns).sum())


def _miss(moves: list[_Move], factor: float) -> float:
    """rad, median, by which `factor` times the rates miss where gravity turned to."""
    carried = np.array([turned(-factor * move.turns) @ move.before for move in moves])
    return float(np.median(_angles(carried, np.array([move.after for move in moves]))))


def _median_and_max(values: list[float]) -> tuple[float, float]:
    return (float(np.median(values)), max(values)) if values else (np.nan, np.nan)


def _means(values: Vector, n: int) -> Vector:
    """(m, 3) means of consecutive windows of n samples; the remainder is left out."""
    first = n * np.arange(len(values) // n)
    return statistics(values, np.stack([first, first + n], axis=1))[0]


def _angles(u: Vector, v: Vector) -> Vector:
    """(m,) rad between unit vectors (m, 3)."""
    return np.asarray(np.arccos(np.clip(np.sum(u * v, axis=1), -1.0, 1.0)))


def _units(v: Vector) -> Vector:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9))
