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
CLEARLY = 3.0  # ratio of misses above which another unit, range or matrix of axes is the right one
BLOCK_S = 0.01
# Factors of rates that were converted as of another range than the chip's; 1, the right range, is first.
RANGE_RATIOS = sorted({a / b for a in GYRO_RANGES_DPS for b in GYRO_RANGES_DPS}, key=lambda ratio: abs(np.log(ratio)))

T = TypeVar("T")


@dataclass(frozen=True)
class Evidence:
    """Recording and its fit; flat and fit are None where the estimation did not get so far.

    gravity_anyway : the caller confirms a gravity [m/s^2] outside the range found on Earth.
    gyro_fault : of the gyroscope, because of which the estimate uses the rests alone; None where it uses the rates,
        or where the user asked for the rests alone.
    changed : None; or what changed the sensor, if the estimate uses only the part of the recording before or after it.
    first : index of the first sample within the whole recording; above 0 for such a part.
    decoded : the recording as read, before anything was masked, and how it was corrected.
    against_rests : why the rests are not enough for an estimate, where no rates were recorded.
    gyro_changes : changes of the gyroscope's bias, which were removed from the rates for the fit.
    """

    recording: Recording
    gravity: float
    flat: Flat | None
    fit: Fit | None
    model: str
    claim: UncertaintyClaim | None = None
    gravity_anyway: bool = False
    gyro_fault: Reason | None = None
    changed: Reason | None = None
    first: int = 0
    decoded: Decoded | None = None
    against_rests: tuple[Reason, ...] = ()
    gyro_changes: tuple[Explanation, ...] = ()

    def part(self, first: int, last: int) -> Evidence:
        """Return the evidence of the samples first..last-1, before their estimation."""
        decoded = None if self.decoded is None else self.decoded.part(first, last)
        part = replace(self, recording=self.recording.part(first, last), first=first, decoded=decoded)
        return replace(part, flat=None, fit=None, claim=None, gyro_changes=())

    @property
    def is_of_now(self) -> bool:
        """True if the estimate is of the sensor as it is now: it did not change after the part that is used."""
        return self.changed is None or self.first > 0

    @property
    def flat_segment(self) -> Flat:
        """Flat segment, for callers that know that there is one."""
        assert self.flat is not None
        return self.flat

    @property
    def estimate(self) -> Fit:
        """Fit, for callers that know that there is one."""
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
        return RestFinder(self.recording, self.flat_segment).typical()

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
    def magnitude_errors(self) -> tuple[float, float, float]:
        """Medians, while the board turns, of | |a| - g | [m/s^2] and of second differences over 10 ms.

        These are of |a| - g [m/s^2], and of the rates [rad/s]. In a hand both are large, on a machine both are small,
        and in smoothed readings only the first is small.
        """
        r, a = self.recording, self.calibrated
        if a is None or self.flat is None:
            return 0.0, np.inf, 0.0
        n = max(round(BLOCK_S * r.rate_hz), 1)
        rate, size = block_means(r.gyr, n) - self.flat.b_omega, lengths(block_means(a, n)) - self.gravity
        turns = lengths(rate)[1:-1] > MOVING_RAD_S
        if not turns.any():
            return 0.0, np.inf, 0.0
        of_each = size[1:-1], np.diff(size, n=2), lengths(np.diff(rate, n=2, axis=0))
        away, bent, of_rates = (float(np.median(np.abs(each[turns]))) for each in of_each)
        return away, bent, of_rates

    @cached_property
    def gravity_moved(self) -> float:
        """Largest angle [rad] between the flat mean and a half-second mean after it."""
        return 0.0 if self.flat is None else self._angle_from(self.flat, self.recording.acc[self.flat.last :])

    @cached_property
    def gravity_carried(self) -> float:
        """Largest angle [rad] between the flat mean and gravity as the rates carry it through the recording."""
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
        """True if the turns of gravity within half seconds agree with rates in deg/s, and not in rad/s."""
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
        # The rates must explain more than no turn at all does; they explain no gravity that does not follow the board.
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
        return self._turns(self.flat_segment, u[whole], u[whole + 1], between[whole])

    @cached_property
    def _far_turns(self) -> list[int]:
        """Indices of the turns, from rest to rest, that move gravity far."""
        u = units(statistics(self.recording.acc, self.rests)[0])
        found: list[int] = np.flatnonzero(_angles(u[1:], u[:-1]) > LEAST_TURN_RAD).tolist()
        return found

    def _is_interrupted(self, first: int, last: int) -> bool:
        begin_s, end_s = self.recording.t[[first, last]].tolist()
        return any(begin_s <= at < end_s for at in self.recording.interrupted)

    @property
    def turned_unrecorded(self) -> bool:
        """True if the board was turned only while the recording was interrupted, between its parts."""
        return self.flat is not None and len(self._far_turns) > 0 and not len(self._turns_of_rests.runs)

    @cached_property
    def gyro_factor(self) -> float:
        """Factor, of RANGE_RATIOS, by which the rates must be multiplied to explain how gravity turned; 1 if in doubt.

        The turns are those from rest to rest; if these are too few, those of half seconds.
        """
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
        """Matrix (3, 3) that corrects the rates of a gyroscope with wrong axes; None if their axes seem right.

        It is a rotation by right angles, or -1. Multiplied by it, the rates explain how gravity turned between rests.
        Only turns count that the rates do not explain as they are; a few of them, or a matrix that does not explain
        them, are not enough.
        """
        turns, misses = self._turns_and_misses
        turns = turns.chosen(misses > MOST_MISS_RAD)
        if len(turns.runs) < FEWEST_TRANSITIONS:
            return None
        rotations = [M for M in signed_permutations() if np.linalg.det(M) > 0.0]
        by, miss = _least_miss(turns, [np.eye(3), -np.eye(3), *rotations])
        return by if miss < MOST_MISS_RAD else None

    @cached_property
    def axes_exchanged_s(self) -> tuple[float, float] | None:
        """Times [s since the recording's start] between which the gyroscope's axes changed to `gyro_axes`, or back.

        On one side of that time the rates explain how gravity turned as they are, and on the other with those axes. It
        is None where the axes did not change.
        """
        if self.gyro_axes is None:
            return None
        turns, misses = self._turns_and_misses
        others = _misses(turns, self.gyro_axes)
        as_they_are, exchanged = CLEARLY * misses < others, CLEARLY * others < misses
        if np.count_nonzero(as_they_are) < FEWEST_TRANSITIONS:
            # So few turns may be explained by chance, but hardly if all of them are at one end of the recording.
            known = as_they_are[as_they_are | exchanged]
            if np.count_nonzero(np.diff(known)) != 1 or misses[as_they_are].max() > CLEARLY * MOST_MISS_RAD:
                return None
        first = int(np.flatnonzero(as_they_are != as_they_are[0])[0])
        t = self.recording.t - self.recording.t[0]
        return float(t[turns.runs[first - 1, 0] - 1]), float(t[turns.runs[first, 1] - 1])

    @cached_property
    def _turns_and_misses(self) -> tuple[_Turns, Vector]:
        """Turns from rest to rest within the gyroscope's range, and the misses (k,) [rad] of the rates, see _misses."""
        turns = self._turns_of_rests.measured
        return turns, _misses(turns, np.eye(3))

    @cached_property
    def gyro_miss(self) -> tuple[float, float]:
        """Median misses [rad] of the turns within the gyroscope's range, and of all turns; 0 of too few turns.

        The miss of a turn is the angle from gravity as the rates carry it to gravity as measured in the next rest.
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
        """Return turns from gravity's directions `before` to `after` (k, 3), during the samples of runs (k, 2)."""
        first, last = np.append(0, np.cumsum(self.recording.gyr_clipped))[runs].T
        return _Turns(before, after, runs, last > first, self._steps(flat))


def once(function: Callable[[Evidence], T]) -> Callable[[Evidence], T]:
    """Cache the value of a function of an Evidence in that object, as cached_property does for a method."""

    @wraps(function)
    def kept(e: Evidence) -> T:
        known = vars(e)
        if function.__qualname__ not in known:
            known[function.__qualname__] = function(e)
        value: T = known[function.__qualname__]
        return value

    return kept


class _Turns(NamedTuple):
    """Turns of gravity, and the gyroscope's steps from which they are predicted.

    before, after : (k, 3) gravity's directions before and after each turn. runs : (k, 2), first and last + 1 of the
    samples with which its steps end. clipped : (k,) True if a rate was beyond the gyroscope's range, so that the turn
    says nothing about the gyroscope. steps : (n, 3) rad, of the whole recording.
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
    """Return that of the matrices `by` with which the rates miss least, and its median miss [rad].

    The first matrix stays unless another one misses clearly less.
    """
    first = _miss(turns, by[0])
    # The result of any other matrix differs from that of the first by half of the turn or more. So where the first one
    # misses by little, no other can miss clearly less.
    if first + first / CLEARLY < 0.5 * np.median(_angles(turns.before, turns.after)):
        return by[0], first
    misses = [first, *(_miss(turns, M) for M in by[1:])]
    least = int(np.argmin(misses))
    least = least if first > CLEARLY * misses[least] else 0
    return by[least], misses[least]


def _miss(turns: _Turns, by: Vector) -> float:
    """Return the median of _misses [rad]."""
    return float(np.median(_misses(turns, by)))


def _misses(turns: _Turns, by: Vector) -> Vector:
    """Return the angles (k,) [rad] by which the rates, multiplied by (3, 3), miss gravity after each turn."""
    return _angles(np.einsum("kij,kj->ki", turned(-turns.steps @ by.T, turns.runs), turns.before), turns.after)


def _angles(u: Vector, v: Vector) -> Vector:
    """Return (m,) angles [rad] between unit vectors (m, 3)."""
    return np.asarray(np.arccos(np.clip(np.sum(u * v, axis=1), -1.0, 1.0)))
