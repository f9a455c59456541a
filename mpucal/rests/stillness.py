"""Stillness detection from windows of samples: whether the board is still, for how long, and how it moved.

The same detector is used live, a window at a time, and for all windows of a recording.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..data import AXES, Vector
from .limits import (
    ANY_HAND,
    MOST_BIAS_RAD_S,
    NOISIEST_ACC_MPS2,
    NOISIEST_GYRO_RAD_S,
    QUIET,
    TIMES_NOISE,
    UNTOUCHED,
    Limits,
    learned,
)
from .windows import CutWindows, Spreads, Window, of_rows

# A bump ends within this time, and turns the board by no more than this angle.
BUMP_S = 2.0
BUMP_RAD = math.radians(3.0)

# A hand's limits are learned from the newest windows that may be rests: at most NEWEST, and more than FEWEST of them.
FEWEST_WINDOWS, NEWEST_WINDOWS = 2, 12

# Means of pure noise differ by at most this many standard deviations.
CHANCE = 4.5


@dataclass(frozen=True)
class Still:
    """Stillness for `seconds`; `acc` [m/s^2] and `gyr` [rad/s] are the means over that time, (3,).

    run : number of the still run; a new run begins when the board was moved, but not when it was only bumped.
    """

    seconds: float
    acc: Vector
    gyr: Vector
    run: int


@dataclass(frozen=True)
class Moved:
    """Motion after `after_s` of stillness.

    what : how the board moved and about which axis, for a message. lost : True if samples are missing, so that it may
        have moved.
    """

    after_s: float
    what: str
    lost: bool = False


class Sighting(NamedTuple):
    """A window, and whether the board was still in it."""

    window: Window
    sight: Still | Moved


class Shares(NamedTuple):
    """Motion in windows (..., 3), as shares of the limits of a rest: above 1, a window is not still.

    acc, gyr : of the standard deviations. turning : of the mean rate.
    """

    acc: Vector
    gyr: Vector
    turning: Vector

    @property
    def level(self) -> Vector:
        """Largest share of each window (...)."""
        return np.asarray(np.maximum(np.maximum(self.acc, self.gyr), self.turning).max(-1))


class Detector:
    """Detector of still runs, fed a window at a time; `shares` judges windows without regard to those before.

    A bump that leaves the board where it was pauses the run; any other motion ends it.

    Parameters
    ----------
    limits : of a window at rest. noise : (3,) standard deviations of the accelerometer [m/s^2] and the gyroscope
        [rad/s] at rest; None: those of the quietest window so far.
    bias : (3,) rad/s of the gyroscope; or, where it is not known, a number: the largest possible magnitude.
    learns : True to widen the limits to the tremor of this hand.

    Attributes
    ----------
    level : motion in the last window, as the largest share of a limit; above 1 it moves.
    rest_rad_s : (3,) mean rate of the last still run, which is the gyroscope's bias.
    """

    def __init__(
        self,
        limits: Limits,
        noise: tuple[Vector, Vector] | None = None,
        bias: Vector | float = MOST_BIAS_RAD_S,
        learns: bool = False,
    ) -> None:
        self._limits, self._given_limits, self._learns = limits, limits, learns
        self._quietest = noise is None
        unknown: Vector = np.full(3, np.inf)
        self._acc_noise, self._gyr_noise = noise if noise is not None else (unknown, unknown)
        self._bias, self._most_rate = (np.zeros(3), bias) if isinstance(bias, float) else (bias, limits.gyro_mean)
        self._spreads: deque[tuple[float, float]] = deque(maxlen=NEWEST_WINDOWS)
        # Number, duration and sums of the windows of this run.
        self._count = 0
        self._seconds: float = 0
        self._acc, self._gyr = np.zeros(3), np.zeros(3)
        self._number = 0
        self._bump_s = 0.0
        self._bump_rad = np.zeros(3)
        self.level = 0.0
        self.rest_rad_s = self._bias

    def shares(self, windows: Spreads) -> Shares:
        """Return the motion in each window, as shares of the limits."""
        vibration = math.sqrt(self._limits.vibration) * windows.acc_noise
        return Shares(
            windows.acc_sd / np.maximum(self._most_acc_sd, vibration),
            windows.gyr_sd / self._most_gyr_sd,
            np.abs(windows.gyr - self._bias) / self._most_rate,
        )

    @property
    def _most_acc_sd(self) -> Vector:
        """Limits (3,) of the accelerometer's standard deviations for this sensor."""
        return np.maximum(self._limits.acc_sd, np.minimum(TIMES_NOISE * self._acc_noise, NOISIEST_ACC_MPS2))

    @property
    def _most_gyr_sd(self) -> Vector:
        """Limits (3,) of the gyroscope's standard deviations for this sensor."""
        return np.maximum(self._limits.gyro_sd, np.minimum(TIMES_NOISE * self._gyr_noise, NOISIEST_GYRO_RAD_S))

    @property
    def seconds(self) -> float:
        """Duration of the stillness, without bumps [s]."""
        return self._seconds

    def forget(self) -> None:
        """Begin a new run, as after a gap."""
        self._begin()

    def add(self, window: Window) -> Still | Moved:
        """Take the next window, and return whether the board is still."""
        if self._quietest:
            self._acc_noise = np.minimum(self._acc_noise, window.acc_sd)
            self._gyr_noise = np.minimum(self._gyr_noise, window.gyr_sd)
        if self._learns:
            self._learn(window)
        shaken = self._shaken(window)
        return self._bumped(window, shaken) if shaken else self.add_quiet(window)

    def add_quiet(self, window: Window) -> Still | Moved:
        """Take the next window, which is whole and shows no motion in itself, as `add` does."""
        # A window that is quiet in itself, but in another orientation, begins the next run.
        stepped = self._stepped(window)
        if stepped:
            moved = Moved(self.seconds, stepped)
            self._begin()
            self._go_on(window)
            return moved
        self._go_on(window)
        self._bump_s, self._bump_rad = 0.0, np.zeros(3)
        acc, self.rest_rad_s = self._means()
        return Still(self.seconds, acc, self.rest_rad_s, self._number)

    def _learn(self, window: Window) -> None:
        """Widen the limits to the tremor in this window and those before, unless no hand trembles so much at rest."""
        beyond = math.sqrt(max(float((window.gyr_sd**2 - self._gyr_noise**2).max()), 0.0))
        turning = float(np.abs(window.gyr - self.rest_rad_s).max())
        if not (beyond < ANY_HAND.gyro_sd and turning < QUIET.gyro_mean):
            return
        self._spreads.append((beyond, turning))
        spread, speed = np.array(self._spreads).T
        noise = float(self._gyr_noise.max())
        self._limits = learned(spread, speed, noise, FEWEST_WINDOWS, self._given_limits)

    def _bumped(self, window: Window, what: str) -> Moved:
        """Take a window with motion: pause the run, and end it if the motion is more than a bump."""
        moved = Moved(self.seconds, what, lost=not window.whole)
        if self._count:
            seconds = window.end_s - window.start_s
            self._bump_s += seconds
            self._bump_rad += (window.gyr - self._means()[1]) * seconds
            if not window.whole or self._bump_s > BUMP_S or np.abs(self._bump_rad).max() > BUMP_RAD:
                self._begin()
        return moved

    def _begin(self) -> None:
        self._count, self._seconds = 0, 0
        self._number += 1
        self._bump_s, self._bump_rad = 0.0, np.zeros(3)

    def _go_on(self, window: Window) -> None:
        """Add a still window to the run."""
        self._acc, self._gyr = (
            (self._acc + window.acc, self._gyr + window.gyr) if self._count else (window.acc, window.gyr)
        )
        self._count += 1
        self._seconds += window.end_s - window.start_s

    def _means(self) -> tuple[Vector, Vector]:
        return self._acc / self._count, self._gyr / self._count

    def _shaken(self, window: Window) -> str:
        """Set the level; return the motion within the window, as text; empty if there is none."""
        shares = acc, gyr, turning = self.shares(window)
        self.level = float(shares.level)
        if not window.whole:
            return "samples were lost"
        if turning.max() > 1.0:
            return _turned(window.gyr - self._bias)
        most = acc.max()
        if gyr.max() > max(most, 1.0):
            return _turned(window.gyr_sd * np.where(gyr == gyr.max(), 1.0, 0.0))
        return _shook(window.acc_sd, acc) if most > 1.0 else ""

    def _stepped(self, window: Window) -> str:
        """Raise the level; return the motion between the run so far and the window, as text; empty if there is none."""
        if not self._count:
            return ""
        acc, gyr = self._means()
        acc_step, gyr_step = window.acc - acc, window.gyr - gyr
        # Two means differ by a slow tremor, up to the standard deviation, and by noise, more so if samples are few.
        share = max(1.0, CHANCE * math.sqrt((1.0 + 1.0 / self._count) / window.count))
        # A spike, or vibration, spreads a window further, but its mean hardly.
        acc_sd = np.minimum(window.acc_sd, self._most_acc_sd)
        acc_ratio = np.abs(acc_step) / (self._limits.acc_step + share * acc_sd)
        gyr_ratio = np.abs(gyr_step) / (self._limits.gyro_step + share * window.gyr_sd)
        acc_most, gyr_most = float(acc_ratio.max()), float(gyr_ratio.max())
        self.level = max(self.level, acc_most, gyr_most)
        if max(acc_most, gyr_most) <= 1.0:
            return ""
        if gyr_most > acc_most:
            return _turned(gyr_step)
        axis = int(acc_ratio.argmax())
        return f"acceleration along {AXES[axis]} changed by {abs(acc_step[axis]):.2f} m/s²"


def is_untouched(acc: Vector) -> bool:
    """Return True if an accelerometer's readings (n, 3) [m/s^2] are so quiet that nobody touches the board."""
    silent = np.zeros(3)
    return bool(Detector(UNTOUCHED, (silent, silent)).shares(of_rows(acc, np.zeros_like(acc))).level < 1.0)


def _turned(gyr: Vector) -> str:
    axis = int(np.abs(gyr).argmax())
    return f"turning at {math.degrees(abs(gyr[axis])):.0f} deg/s about {AXES[axis]}"


def _shook(acc_sd: Vector, ratio: Vector) -> str:
    axis = int(ratio.argmax())
    return f"shaking by {acc_sd[axis]:.2f} m/s² along {AXES[axis]}"


def still_windows(detector: Detector, windows: CutWindows) -> Iterator[tuple[int, int, int]]:
    """Yield (number of its run, first, last + 1 of its samples) for each still window.

    All windows are compared with the limits at once, so `detector` must not change them: it neither learns nor looks
    for the quietest window.
    """
    moving = detector.shares(windows).level > 1.0
    for k, moves in enumerate(moving.tolist()):
        if moves and not detector.seconds:
            continue
        window = windows[k]
        state = detector.add_quiet(window) if window.whole and not moves else detector.add(window)
        if isinstance(state, Still):
            yield state.run, k * windows.n, (k + 1) * windows.n
