"""Evidence for a verdict: facts about a recording and its fit, each computed once, from which the checks conclude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import NamedTuple, TypeVar

import numpy as np

from ..data import GYRO_RANGES_DPS, Mask, Recording, Vector
from ..reasons import Reason
from ..rests.flat import Flat, find_flat, flat_statistics
from ..rests.intervals import Intervals, RestFinder, block_means, statistics
from ..rests.limits import ENOUGH_ORIENTATIONS, LEAST_TURN_RAD, MOVING_RAD_S
from ..rests.windows import WINDOW_S
from .fit import Fit
from .hypotheses import Explanation
from .parameters import ACCELEROMETER
from .rotation import fibonacci_sphere, lengths, sides_down, signed_permutations, turned, units
from .tilt import tilted_directions
from .transitions import FEWEST_TRANSITIONS, MOST_MISS_RAD
from .uncertainty import Uncertainty, UncertaintyClaim, is_usable, propagate
from .words import Decoded

LEAST_STEP_RAD = np.deg2rad(2.0)  # turn of gravity in half a second that is above noise
CLEARLY = 3.0  # ratio of misses above which another unit or range is the right one
BLOCK_S = 0.01
# Ratios of the chip's ranges, by which rates are off that were read at another one; that of the same range first.
RANGE_RATIOS = sorted({a / b for a in GYRO_RANGES_DPS for b in GYRO_RANGES_DPS}, key=lambda ratio: abs(np.log(ratio)))

T = TypeVar("T")


@dataclass(frozen=True)
class Evidence:
    """Recording and its fit; flat and fit are None where the estimation did not get so far.

    gravity_anyway : the caller confirms a gravity [m/s^2] outside the range found on Earth.
    gyroscope : why the estimate uses the rests alone; None where it does not, or where that was asked for.
    changed : what changed the sensor before or after the part of the recording that the estimate uses alone, or None.
    first : sample of the whole recording with which this one begins.
    decoded : the recording's words, before anything was masked, and how they were corrected.
    against_rests : why it cannot use the rests alone, where nothing else was recorded.
    walks : changes of the gyroscope's bias, which are removed from the rates for the fit.
    """

    recording: Recording
    gravity: float
    flat: Flat | None
    fit: Fit | None
    model: str
    claim: UncertaintyClaim | None = None
    gravity_anyway: bool = False
    gyroscope: Reason | None = None
    changed: Reason | None = None
    first: int = 0
    decoded: Decoded | None = None
    against_rests: tuple[Reason, ...] = ()
    walks: tuple[Explanation, ...] = ()

    def part(self, first: int, last: int) -> Evidence:
        """Return the evidence of the samples first..last-1, before their estimation."""
        decoded = None if self.decoded is None else self.decoded.part(first, last)
        part = replace(self, recording=self.recording.part(first, last), first=first, decoded=decoded)
        return replace(part, flat=None, fit=None, claim=None, walks=())

    @property
    def is_of_now(self) -> bool:
        """True if the sensor did not change after what the estimate uses."""
        return self.changed is None or self.first > 0

    @property
    def rest(self) -> Flat:
        """Flat segment, where there is one."""
        assert self.flat is not None
        return self.flat

    @property
    def estimate(self) -> Fit:
        """Fit, where there is one."""
        assert self.fit is not None
        return self.fit

    @cached_property
    def uncertainty(self) -> Uncertainty | None:
        """Uncertainty of a calibrated measurement by the fit's covariance; None where D is unusable."""
        fit = self.fit
        if fit is None or not is_usable(fit):
            return None
        directions = None
        if self.model == "tilt" and self.flat is not None:
            directions = tilted_directions(self.flat.y / np.linalg.norm(self.flat.y), fibonacci_sphere())
        known = propagate(fit.D, fit.covariance[ACCELEROMETER, ACCELEROMETER], self.gravity, directions)
        return known if known.rms_mps2 > 0.0 else None  # the inverse of a singular H is no covariance

    @cached_property
    def calibrated(self) -> Vector | None:
        """(n, 3) m/s^2, every sample by equation (4)."""
        if self.fit is None or self.uncertainty is None:
            return None
        return np.asarray((self.recording.acc - self.fit.b_a) @ np.linalg.inv(self.fit.D).T)

    @cached_property
    def rests(self) -> Intervals:
        """Typical rests (k, 2), first and last + 1 of their samples; there must be a flat segment."""
        return RestFinder(self.recording, self.rest).typical()

    @cached_property
    def was_held_all_around(self) -> bool:
        """True if the board rested on each of its six sides, and ENOUGH_ORIENTATIONS times or more in all."""
        if self.flat is None or self.calibrated is None:
            return False
        means = statistics(self.calibrated, self.rests)[0]
        rests = np.bincount(sides_down(means), minlength=6)
        return bool(rests.all()) and rests.sum() >= ENOUGH_ORIENTATIONS

    @cached_property
    def magnitude(self) -> Vector:
        """(n,) m/s^2, |y| of every sample."""
        return lengths(self.recording.acc)

    @cached_property
    def median_mps2(self) -> float:
        """Median of |y| [m/s^2]."""
        return float(np.median(self.magnitude))

    @cached_property
    def straying(self) -> tuple[float, float]:
        """Medians, while the board turns, of the distance of |a| from g and of its bend within 10 ms [m/s^2]."""
        r, a = self.recording, self.calibrated
        if a is None or self.flat is None:
            return 0.0, np.inf
        n = max(round(BLOCK_S * r.rate_hz), 1)
        turns = lengths(block_means(r.gyr, n) - self.flat.b_omega)[1:-1] > MOVING_RAD_S
        size = lengths(block_means(a, n)) - self.gravity
        away, bent = np.abs(size[1:-1])[turns], np.abs(np.diff(size, n=2))[turns]
        return (float(np.median(away)), float(np.median(bent))) if len(away) else (0.0, np.inf)

    @cached_property
    def gravity_moved(self) -> float:
        """Largest angle [rad] between the flat mean and a half-second mean after it."""
        return 0.0 if self.flat is None else self._angle_from(self.flat, self.recording.acc[self.flat.last :])

    @cached_property
    def gravity_carried(self) -> float:
        """Largest angle [rad] between the flat mean and where the rates carry it, from half second to half second."""
        if self.flat is None or not np.isfinite(self.recording.gyr).all():
            return 0.0
        u = start = units(self.flat.y[None])
        first = np.arange(self.flat.last, len(self.recording) - self._half_second, self._half_second)
        steps, runs = self._steps(self.flat), np.stack([first, first + self._half_second], axis=1)
        moving = lengths(statistics(steps, runs)[0]) * self._half_second > MOVING_RAD_S * WINDOW_S  # less may be drift
        largest = 0.0
        for F in turned(-steps, runs[moving]):
            u = u @ F.T
            largest = max(largest, float(_angles(u, start)[0]))
        return largest

    @cached_property
    def gravity_moved_before(self) -> float:
        """Largest angle [rad] between the flat mean and a half-second mean before it."""
        return 0.0 if self.flat is None else self._angle_from(self.flat, self.recording.acc[: self.flat.first])

    def _angle_from(self, flat: Flat, acc: Vector) -> float:
        return float(_angles(units(block_means(acc, self._half_second)), units(flat.y[None])).max(initial=0.0))

    @property
    def _half_second(self) -> int:
        return max(round(WINDOW_S * self.recording.rate_hz), 1)

    @cached_property
    def rates_in_degrees(self) -> bool:
        """True if gravity turns from half second to half second as the rates say in deg/s, and not as in rad/s."""
        flat = self.flat
        if flat is None:
            segment = find_flat(replace(self.recording, gyr=np.deg2rad(self.recording.gyr)))
            if segment is None:
                return False
            flat = flat_statistics(self.recording, segment)
        turns = self._turns_of_half_seconds(flat)
        rotated, angles = np.append(0.0, np.cumsum(lengths(turns.steps))), _angles(turns.before, turns.after)
        path = np.diff(rotated[turns.runs]).sum()
        if not path > CLEARLY * angles.sum() > 0.0:  # turns about the vertical exceed it, too
            return False
        by, miss = _least_miss(turns, [np.eye(3), np.deg2rad(np.eye(3))])
        # of a gravity that does not follow the board, no turn at all explains as much
        return bool(by[0, 0] < 1.0 and CLEARLY * miss < np.median(angles))

    def _turns_of_half_seconds(self, flat: Flat) -> _Turns:
        """Return turns of gravity between the middles of neighbouring half seconds."""
        n = self._half_second
        u = units(block_means(self.recording.acc[flat.last :], n))
        at = np.flatnonzero(_angles(u[1:], u[:-1]) > LEAST_STEP_RAD)
        first = flat.last + n // 2 + at * n
        return self._turns(flat, u[at], u[at + 1], np.stack([first, first + n], axis=1))

    @cached_property
    def _turns_of_rests(self) -> _Turns:
        """Turns from rest to rest that move gravity far, without interruption."""
        u = units(statistics(self.recording.acc, self.rests)[0])
        between = np.stack([self.rests[:-1, 1], self.rests[1:, 0]], axis=1)
        whole = np.array([k for k in self._far_turns if not self._is_interrupted(*between[k] - (1, 0))], np.intp)
        return self._turns(self.rest, u[whole], u[whole + 1], between[whole])

    @cached_property
    def _far_turns(self) -> list[int]:
        """Places of the turns, from rest to rest, that move gravity far."""
        u = units(statistics(self.recording.acc, self.rests)[0])
        found: list[int] = np.flatnonzero(_angles(u[1:], u[:-1]) > LEAST_TURN_RAD).tolist()
        return found

    def _is_interrupted(self, first: int, last: int) -> bool:
        begin_s, end_s = self.recording.t[[first, last]].tolist()
        return any(begin_s <= at < end_s for at in self.recording.interrupted)

    @property
    def turned_unrecorded(self) -> bool:
        """True if the board was turned between the parts of an interrupted recording alone."""
        return self.flat is not None and len(self._far_turns) > 0 and not len(self._turns_of_rests.runs)

    @cached_property
    def gyro_factor(self) -> float:
        """Ratio of ranges with which rates explain how gravity turned from rest to rest, or of few, by half seconds."""
        if self.flat is None:
            return 1.0
        turns = self._turns_of_rests.measured
        if len(turns.runs) < FEWEST_TRANSITIONS:
            turns = self._turns_of_half_seconds(self.flat).measured
        if len(turns.runs) < FEWEST_TRANSITIONS:
            return 1.0
        by, miss = _least_miss(turns, [ratio * np.eye(3) for ratio in RANGE_RATIOS])
        return float(by[0, 0]) if miss < MOST_MISS_RAD else 1.0

    @cached_property
    def gyro_axes(self) -> Vector | None:
        """Rotation (3, 3) by right angles, or -1, with which rates explain how gravity turned between rests.

        It is None where it explains none, and where the rates explain all but few turns as they are.
        """
        turns, misses = self._turns_and_misses
        turns = turns.chosen(misses > MOST_MISS_RAD)
        if len(turns.runs) < FEWEST_TRANSITIONS:
            return None
        rotations = [M for M in signed_permutations() if np.linalg.det(M) > 0.0]
        by, miss = _least_miss(turns, [np.eye(3), -np.eye(3), *rotations])
        return by if miss < MOST_MISS_RAD else None

    @cached_property
    def exchanged(self) -> tuple[float, float] | None:
        """Times [s since the recording's start] between which axes were exchanged, or None.

        Before or after, the rates explain how gravity turned as they are, and on the other side only with other axes.
        """
        if self.gyro_axes is None:
            return None
        turns, misses = self._turns_and_misses
        others = _misses(turns, self.gyro_axes)
        as_they_are, exchanged = CLEARLY * misses < others, CLEARLY * others < misses
        if np.count_nonzero(as_they_are) < FEWEST_TRANSITIONS:
            # so few may be by chance, but hardly at one end of a recording
            known = as_they_are[as_they_are | exchanged]
            if np.count_nonzero(np.diff(known)) != 1 or misses[as_they_are].max() > CLEARLY * MOST_MISS_RAD:
                return None
        first = int(np.flatnonzero(as_they_are != as_they_are[0])[0])
        t = self.recording.t - self.recording.t[0]
        return float(t[turns.runs[first - 1, 0] - 1]), float(t[turns.runs[first, 1] - 1])

    @cached_property
    def _turns_and_misses(self) -> tuple[_Turns, Vector]:
        """Turns from rest to rest within the gyroscope's range, and by how much the rates miss gravity after each."""
        turns = self._turns_of_rests.measured
        return turns, _misses(turns, np.eye(3))

    @cached_property
    def gyro_miss(self) -> tuple[float, float]:
        """Median angles [rad] from gravity as the rates carry it to gravity at the next rest; 0 of too few rests.

        The first is that of the turns within the gyroscope's range, the second that of all turns.
        """
        if self.flat is None:
            return 0.0, 0.0
        turns = self._turns_of_rests
        misses = _misses(turns, np.eye(3))
        within, of_all = (
            float(np.median(these)) if len(these) >= FEWEST_TRANSITIONS else 0.0
            for these in (misses[~turns.clipped], misses)
        )
        return within, of_all

    def _steps(self, flat: Flat) -> Vector:
        """Return (n, 3) rad, the gyroscope's step that ends with each sample."""
        r = self.recording
        return np.asarray(np.diff(r.t, prepend=r.t[0])[:, None] * (r.gyr - flat.b_omega))

    def _turns(self, flat: Flat, before: Vector, after: Vector, runs: Intervals) -> _Turns:
        """Return the turns whose steps end with the samples of runs (k, 2)."""
        first, last = np.append(0, np.cumsum(self.recording.gyr_clipped))[runs].T
        return _Turns(before, after, runs, last > first, self._steps(flat))


def once(function: Callable[[Evidence], T]) -> Callable[[Evidence], T]:
    """Keep the value of a function of an Evidence with it, as cached_property does that of a method."""

    @wraps(function)
    def kept(e: Evidence) -> T:
        known = vars(e)
        if function.__qualname__ not in known:
            known[function.__qualname__] = function(e)
        value: T = known[function.__qualname__]
        return value

    return kept


class _Turns(NamedTuple):
    """Turns: gravity's directions before and after each (k, 3), and the samples (k, 2) that end its steps.

    clipped : (k,) it went beyond the gyroscope's range, so that its rates say nothing about the gyroscope.
    steps : (n, 3) rad, those of the whole recording.
    """

    before: Vector
    after: Vector
    runs: Intervals
    clipped: Mask
    steps: Vector

    def chosen(self, which: Mask) -> _Turns:
        """Return some of the turns."""
        before, after, runs, clipped, steps = self
        return _Turns(before[which], after[which], runs[which], clipped[which], steps)

    @property
    def measured(self) -> _Turns:
        """Turns within the gyroscope's range."""
        return self.chosen(~self.clipped)


def _least_miss(turns: _Turns, by: list[Vector]) -> tuple[Vector, float]:
    """Return which of matrices (3, 3) makes the rates miss least, the first if in doubt, and the median angle [rad]."""
    first = _miss(turns, by[0])
    # Each other matrix carries gravity to half of its turn or more from where the first one does, so that it cannot
    # miss clearly less.
    if first + first / CLEARLY < 0.5 * np.median(_angles(turns.before, turns.after)):
        return by[0], first
    misses = [first, *(_miss(turns, M) for M in by[1:])]
    least = int(np.argmin(misses))
    least = least if first > CLEARLY * misses[least] else 0
    return by[least], misses[least]


def _miss(turns: _Turns, by: Vector) -> float:
    """Return the median angle [rad] by which the rates, multiplied by (3, 3), miss gravity after the turns."""
    return float(np.median(_misses(turns, by)))


def _misses(turns: _Turns, by: Vector) -> Vector:
    """Return the angles (k,) [rad] by which the rates, multiplied by (3, 3), miss gravity after each turn."""
    return _angles(np.einsum("kij,kj->ki", turned(-turns.steps @ by.T, turns.runs), turns.before), turns.after)


def _angles(u: Vector, v: Vector) -> Vector:
    """Return (m,) angles [rad] between unit vectors (m, 3)."""
    return np.asarray(np.arccos(np.clip(np.sum(u * v, axis=1), -1.0, 1.0)))
