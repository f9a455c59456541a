"""Whether rests in ordinary use contradict a calibration: their magnitudes and rates, one rest at a time, for days.

A rest shows |a| - g, and the mean rate; nothing carries gravity from one rest to the next over hours, so that neither a
mount nor a gyroscope's scale factor is seen. A rest may also be none: a vehicle that brakes evenly is as still.
Therefore no single rest decides.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ..calibration.verification import BIAS_RAD_S, FLOOR_MPS2
from ..data import STANDARD_GRAVITY_MPS2, Samples, Vector
from ..rests.limits import QUIET
from ..rests.stillness import Detector, Still
from ..rests.windows import Window, Windows
from ..result.calibration import Calibration
from . import drift
from .hypotheses import NOTHING, weigh
from .observed import BETA, DELTA, PARAMETERS, Observed, of_accelerometer

BLOCK_S = 0.5
# of a rest: so long at least, and at most: a board that lies for hours rests many times
LEAST_BLOCKS, MOST_BLOCKS = 5, 21
# the last rests, of which this many at least are needed
RESTS, LEAST_RESTS = 16, 4
# days of rests are looked at one by one: each may err by chance less often than a check does
FALSE_ALARMS = 2e-4
DAY_S = 86400.0
TO_DO = "see what `mpucal check` says"


@dataclass(frozen=True)
class _Rest:
    """Mean acceleration (3,) and its variance, mean rate (3,) and its variance, all calibrated; temperature or NaN."""

    a: Vector
    a_variance: float
    w: Vector
    w_variance: float
    temperature_c: float


@dataclass(frozen=True)
class Contradiction:
    """What rests say against a calibration, of the accelerometer or the gyroscope, at `t_s` of the samples."""

    t_s: float
    sensor: str
    what: str
    do: str = TO_DO

    def __str__(self) -> str:
        return f"{self.what}: {self.do}"


class Watch:
    """Looks at calibrated samples as they come, in constant memory; each sensor's finding is told once.

    Parameters
    ----------
    calibration : ready for these samples. days : since it was made, at the first of them.
    """

    def __init__(self, calibration: Calibration, days: float) -> None:
        self._calibration, self._days = calibration, days
        self._gravity = float(calibration.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
        self._first_s: float | None = None
        self._t_s, self._temperature_c = 0.0, math.nan
        self._windows, self._stillness, self._run = Windows(BLOCK_S), Detector(QUIET), 0
        self._blocks: list[Vector] = []
        self._rests: deque[_Rest] = deque(maxlen=RESTS)
        self._told: set[str] = set()

    def add(self, calibrated: Samples) -> list[Contradiction]:
        """What these samples bring to light."""
        if len(calibrated):
            self._t_s = float(calibrated.t[-1])
            self._first_s = self._t_s if self._first_s is None else self._first_s
            self._temperature_c = float(calibrated.temperature_c[-1])
        return [each for window in self._windows.add(calibrated) for each in self._look(window)]

    def _look(self, window: Window) -> list[Contradiction]:
        """Half a second more."""
        sight = self._stillness.add(window)
        found = [] if isinstance(sight, Still) and sight.run == self._run else self._over()
        if isinstance(sight, Still):
            self._run = sight.run
            within = float(window.acc_sd.max()) ** 2 / window.count
            self._blocks.append(np.concatenate([window.acc, window.gyr, [self._temperature_c, within]]))
        if len(self._blocks) == MOST_BLOCKS:
            found += self._over()
        return found

    def _over(self) -> list[Contradiction]:
        """A rest is over."""
        # a hand settles, and leaves early
        blocks, self._blocks = np.array(self._blocks[1:-1]), []
        if len(blocks) < LEAST_BLOCKS - 2:
            return []
        n = len(blocks)
        between, within = blocks.var(0, ddof=1), float(blocks[:, 7].mean())
        a_variance = max(float(between[:3].mean()), within) / n + FLOOR_MPS2**2
        w_variance = float(between[3:6].mean()) / n + BIAS_RAD_S**2
        self._rests.append(_Rest(blocks[:, :3].mean(0), a_variance, blocks[:, 3:6].mean(0), w_variance, blocks[-1, 6]))
        return self._judged(list(self._rests))

    def _judged(self, rests: list[_Rest]) -> list[Contradiction]:
        if len(rests) < LEAST_RESTS:
            return []
        T, T_0 = rests[-1].temperature_c, self._calibration.sensor.temperature_c
        change_c = None if T_0 is None or math.isnan(T) else T - T_0
        days = self._days + (self._t_s - (self._first_s or 0.0)) / DAY_S
        nothing = drift.own_uncertainty(self._calibration) + drift.ageing(self._calibration, days, change_c)
        happenings = drift.happenings(self._calibration, change_c)
        observed = self._observed(rests)
        weighed = weigh(observed, nothing, happenings)
        what = weighed.told
        # few orientations do not tell a bias from a scale factor
        sensor = "gyroscope" if what.startswith("gyroscope") else "accelerometer"
        if what == NOTHING or sensor in self._told or weighed.probability > FALSE_ALARMS:
            return []
        for k in range(len(rests)):
            without = weigh(self._observed(rests[:k] + rests[k + 1 :]), nothing, happenings)
            if without.told == NOTHING:
                return []
        self._told.add(sensor)
        said = f"the last {len(rests)} rests contradict the calibration ({self._off(rests, sensor)})"
        return [Contradiction(self._t_s, sensor, said)]

    def _off(self, rests: list[_Rest], sensor: str) -> str:
        if sensor == "gyroscope":
            rate = math.degrees(max(float(np.linalg.norm(rest.w)) for rest in rests))
            return f"it turns by up to {rate:.2g} deg/s"
        off = max((float(np.linalg.norm(rest.a)) - self._gravity for rest in rests), key=abs)
        return f"|a| has an error of up to {off / drift.MG:+.2g} mg"

    def _observed(self, rests: list[_Rest]) -> Observed:
        k, gyro = len(rests), bool(np.isfinite([rest.w for rest in rests]).all())
        a = np.array([rest.a for rest in rests])
        length = np.linalg.norm(a, axis=1)
        r, variance = length - self._gravity, [rest.a_variance for rest in rests]
        J = np.zeros((k, PARAMETERS))
        J[:, : BETA.stop] = [one / norm @ of_accelerometer(one) for one, norm in zip(a, length, strict=True)]
        # a calibration without b_omega says nothing against a rate
        if gyro and np.isfinite(self._calibration.b_omega).all():
            of_rates = np.zeros((3 * k, PARAMETERS))
            of_rates[:, DELTA] = np.tile(np.eye(3), (k, 1))
            r, J = np.concatenate([r, *(rest.w for rest in rests)]), np.vstack([J, of_rates])
            variance += [rest.w_variance for rest in rests for _ in range(3)]
        return Observed(r, J, np.diag(variance), -a / length[:, None], None, 0.0)
