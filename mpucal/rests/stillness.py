"""Stillness detection: whether the board is still, for how long, and what moved it, from windows of samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .windows import Window


@dataclass(frozen=True)
class StillnessLimits:
    """Limits of a still window and of the step between two; the accelerometer's in m/s^2, the gyro's in rad/s.

    Attributes
    ----------
    acc_sd, gyr_sd : a window's standard deviations may reach this, however quiet the sensor was before.
    acc_step, gyr_step : its means may be this far, beyond its spread, from those of the stillness before it:
        a turn at a constant rate has no spread, only a mean that moves.
    """

    acc_sd: float
    gyr_sd: float
    acc_step: float
    gyr_step: float


# A table may hum; a hand trembles by 0.1 m/s^2 and 1 deg/s at 2 to 10 Hz.
ON_A_TABLE = StillnessLimits(acc_sd=0.15, gyr_sd=0.03, acc_step=0.08, gyr_step=0.02)
IN_THE_HAND = StillnessLimits(acc_sd=0.3, gyr_sd=0.06, acc_step=0.3, gyr_step=0.06)

# A noisier sensor may exceed these by what its quietest window shows, up to this factor ...
OF_QUIETEST = 2.5
# ... but never beyond this, however noisy it is.
ACC_SD_MAX_MPS2, GYRO_SD_MAX_RAD_S = 0.5, 0.15

# A bump is over after so long, and has not turned the board by more than this.
BUMP_S = 2.0
BUMP_RAD = math.radians(3.0)

# The MPU-6050's gyro may be off by 20 deg/s at rest; a board that seems to turn faster than this turns.
GYRO_BIAS_MAX_RAD_S = math.radians(30.0)

AXES = "xyz"


@dataclass(frozen=True)
class Still:
    """It has been still for `seconds`; `acc` [m/s^2] and `gyr` [rad/s] are the means over that time, (3,).

    `run` numbers the stillnesses: it counts up where the board was moved, and not where it was only bumped.
    """

    seconds: float
    acc: Vector
    gyr: Vector
    run: int


@dataclass(frozen=True)
class Moved:
    """It moves, after `after_s` of stillness; `what`: which sensor saw it, how much and about which axis.

    `lost` : samples are missing, so that nobody knows whether it moved.
    """

    after_s: float
    what: str
    lost: bool = False


class StillnessDetector:
    """Follows one still run after another, a window at a time.

    A bump that leaves the board where it was pauses the run; any other movement ends it.

    Attributes
    ----------
    level : how near the last window came to what counts as moving; 1 is there.
    rest_rad_s : (3,) what the gyroscope read at the last stillness: its bias.
    """

    def __init__(self, limits: StillnessLimits) -> None:
        self._limits = limits
        self._acc_quiet = np.full(3, np.inf)
        self._gyr_quiet = np.full(3, np.inf)
        # the windows of this run, added up one after the other
        self._count = 0
        self._seconds: float = 0
        self._acc, self._gyr = np.zeros(3), np.zeros(3)
        self._number = 0
        self._bump_s = 0.0
        self._bump_rad = np.zeros(3)
        self.level = 0.0
        self.rest_rad_s = np.zeros(3)

    @property
    def seconds(self) -> float:
        """How long it has been still, a bump not counted [s]."""
        return self._seconds

    def forget(self) -> None:
        """What comes next has nothing to do with what was."""
        self._begin()

    def add(self, window: Window) -> Still | Moved:
        """What `window` shows."""
        self._acc_quiet = np.minimum(self._acc_quiet, window.acc_sd)
        self._gyr_quiet = np.minimum(self._gyr_quiet, window.gyr_sd)
        shaken = self._shaken(window)
        if shaken:
            return self._bumped(window, shaken)
        # a window that is quiet in itself, only elsewhere, is where the next stillness begins
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

    def _bumped(self, window: Window, what: str) -> Moved:
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
        """It is still in this window, too."""
        self._acc, self._gyr = (
            (self._acc + window.acc, self._gyr + window.gyr) if self._count else (window.acc, window.gyr)
        )
        self._count += 1
        self._seconds += window.end_s - window.start_s

    def _means(self) -> tuple[Vector, Vector]:
        return self._acc / self._count, self._gyr / self._count

    def _shaken(self, window: Window) -> str:
        """What within the window says that it is not still, or nothing."""
        acc = window.acc_sd / np.clip(OF_QUIETEST * self._acc_quiet, self._limits.acc_sd, ACC_SD_MAX_MPS2)
        gyr = window.gyr_sd / np.clip(OF_QUIETEST * self._gyr_quiet, self._limits.gyr_sd, GYRO_SD_MAX_RAD_S)
        turning = np.abs(window.gyr) / GYRO_BIAS_MAX_RAD_S
        self.level = float(max(acc.max(), gyr.max(), turning.max()))
        if not window.whole:
            return "samples were lost"
        if turning.max() > 1.0:
            return _turned(window.gyr)
        if gyr.max() > max(acc.max(), 1.0):
            return _turned(window.gyr_sd * np.where(gyr == gyr.max(), 1.0, 0.0))
        return _shook(window.acc_sd, acc) if acc.max() > 1.0 else ""

    def _stepped(self, window: Window) -> str:
        """What between the window and the stillness before it says that it moved, or nothing."""
        if not self._count:
            return ""
        acc, gyr = self._means()
        acc_step, gyr_step = window.acc - acc, window.gyr - gyr
        # a mean over a window with slow tremor in it is off by a part of that tremor
        acc_ratio = np.abs(acc_step) / (self._limits.acc_step + window.acc_sd)
        gyr_ratio = np.abs(gyr_step) / (self._limits.gyr_step + window.gyr_sd)
        self.level = float(max(self.level, acc_ratio.max(), gyr_ratio.max()))
        if max(acc_ratio.max(), gyr_ratio.max()) <= 1.0:
            return ""
        if gyr_ratio.max() > acc_ratio.max():
            return _turned(gyr_step)
        axis = int(acc_ratio.argmax())
        return f"acceleration along {AXES[axis]} changed by {abs(acc_step[axis]):.2f} m/s²"


def _turned(gyr: Vector) -> str:
    axis = int(np.abs(gyr).argmax())
    return f"turning at {math.degrees(abs(gyr[axis])):.0f} deg/s about {AXES[axis]}"


def _shook(acc_sd: Vector, ratio: Vector) -> str:
    axis = int(ratio.argmax())
    return f"shaking by {acc_sd[axis]:.2f} m/s² along {AXES[axis]}"
