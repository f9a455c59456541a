"""Monitor of a calibration in ordinary use: magnitudes and rates of rests, for days, against the calibration.

A rest shows |a| - g and the mean rate. Gravity is not carried from one rest to the next over hours, so that neither a
mount nor a gyroscope's scale factor is observed. Some rests are not rests: a vehicle that brakes evenly looks as still.
Therefore no single rest decides.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ..calibration.verification import BIAS_RAD_S, FLOOR_MPS2
from ..data import Samples, Vector
from ..rests.limits import QUIET
from ..rests.stillness import Detector, Still
from ..rests.windows import WINDOW_S, Window, Windows
from ..result.calibration import Calibration
from ..result.error_model import MG_PER_MPS2
from . import drift
from .hypotheses import NOTHING, compare_hypotheses
from .observed import BETA, DELTA, LEAST_ORIENTATIONS, PARAMETERS, Observations, accelerometer_jacobian

# Blocks of a rest, at least and at most: a board that lies for hours gives many rests.
LEAST_BLOCKS, MOST_BLOCKS = 5, 21
# Number of the last rests that are compared.
RESTS = 16
# Days of rests are compared one by one: each comparison must give fewer false alarms than a check.
FALSE_ALARMS = 2e-4
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
    """Contradiction between rests and a calibration, in one `sensor`, at `t_s` of the samples."""

    t_s: float
    sensor: str
    what: str
    do: str = TO_DO

    def __str__(self) -> str:
        return f"{self.what}: {self.do}"


class DriftMonitor:
    """Monitor of calibrated samples, in constant memory; it reports each sensor once.

    Parameters
    ----------
    calibration : the one that was applied. days : its age at the first sample.
    """

    def __init__(self, calibration: Calibration, days: float) -> None:
        self._calibration, self._days = calibration, days
        self._gravity = calibration.gravity
        self._first_s: float | None = None
        self._t_s, self._temperature_c = 0.0, math.nan
        self._windows, self._stillness, self._run = Windows(WINDOW_S), Detector(QUIET), 0
        self._blocks: list[Vector] = []
        self._rests: deque[_Rest] = deque(maxlen=RESTS)
        self._reported: set[str] = set()

    def add(self, calibrated: Samples) -> list[Contradiction]:
        """Return the contradictions that these samples complete."""
        if len(calibrated):
            self._t_s = float(calibrated.t[-1])
            self._first_s = self._t_s if self._first_s is None else self._first_s
            self._temperature_c = float(calibrated.temperature_c[-1])
        return [each for window in self._windows.add(calibrated) for each in self._add_window(window)]

    def _add_window(self, window: Window) -> list[Contradiction]:
        sight = self._stillness.add(window)
        found = [] if isinstance(sight, Still) and sight.run == self._run else self._end_rest()
        if isinstance(sight, Still):
            self._run = sight.run
            within = float(window.acc_sd.max()) ** 2 / window.count
            self._blocks.append(np.concatenate([window.acc, window.gyr, [self._temperature_c, within]]))
        if len(self._blocks) == MOST_BLOCKS:
            found += self._end_rest()
        return found

    def _end_rest(self) -> list[Contradiction]:
        # At the first and the last block a hand may still, or already, move.
        blocks, self._blocks = np.array(self._blocks[1:-1]), []
        if len(blocks) < LEAST_BLOCKS - 2:
            return []
        n = len(blocks)
        between, within = blocks.var(0, ddof=1), float(blocks[:, 7].mean())
        a_variance = max(float(between[:3].mean()), within) / n + FLOOR_MPS2**2
        w_variance = float(between[3:6].mean()) / n + BIAS_RAD_S**2
        self._rests.append(_Rest(blocks[:, :3].mean(0), a_variance, blocks[:, 3:6].mean(0), w_variance, blocks[-1, 6]))
        return self._compare(list(self._rests))

    def _compare(self, rests: list[_Rest]) -> list[Contradiction]:
        """Return the contradiction of these rests, if it is beyond chance and does not rest on a single one."""
        if len(rests) < LEAST_ORIENTATIONS:
            return []
        T, T_0 = rests[-1].temperature_c, self._calibration.sensor.temperature_c
        change_c = None if T_0 is None or math.isnan(T) else T - T_0
        days = self._days + (self._t_s - (self._first_s or 0.0)) / 86400.0
        nothing = drift.own_uncertainty(self._calibration) + drift.ageing(self._calibration, days, change_c)
        hypotheses = drift.hypotheses(self._calibration, change_c)
        comparison = compare_hypotheses(self._observe(rests), nothing, hypotheses)
        what = comparison.likeliest
        # Few orientations cannot tell a bias from a scale factor, so only the sensor is named.
        sensor = "gyroscope" if what.startswith("gyroscope") else "accelerometer"
        if what == NOTHING or sensor in self._reported or comparison.probability > FALSE_ALARMS:
            return []
        for k in range(len(rests)):
            without = compare_hypotheses(self._observe(rests[:k] + rests[k + 1 :]), nothing, hypotheses)
            if without.likeliest == NOTHING:
                return []
        self._reported.add(sensor)
        what = f"the last {len(rests)} rests contradict the calibration ({self._error_text(rests, sensor)})"
        return [Contradiction(self._t_s, sensor, what)]

    def _error_text(self, rests: list[_Rest], sensor: str) -> str:
        if sensor == "gyroscope":
            rate = math.degrees(max(float(np.linalg.norm(rest.w)) for rest in rests))
            return f"the rate is up to {rate:.2g} deg/s"
        off = max((float(np.linalg.norm(rest.a)) - self._gravity for rest in rests), key=abs)
        return f"|a| is wrong by up to {off * MG_PER_MPS2:+.2g} mg"

    def _observe(self, rests: list[_Rest]) -> Observations:
        k, gyro = len(rests), bool(np.isfinite([rest.w for rest in rests]).all())
        a = np.array([rest.a for rest in rests])
        length = np.linalg.norm(a, axis=1)
        r, variance = length - self._gravity, [rest.a_variance for rest in rests]
        J = np.zeros((k, PARAMETERS))
        J[:, : BETA.stop] = [one / norm @ accelerometer_jacobian(one) for one, norm in zip(a, length, strict=True)]
        # A calibration without b_omega has no residual of the rate.
        if gyro and np.isfinite(self._calibration.b_omega).all():
            of_rates = np.zeros((3 * k, PARAMETERS))
            of_rates[:, DELTA] = np.tile(np.eye(3), (k, 1))
            r, J = np.concatenate([r, *(rest.w for rest in rests)]), np.vstack([J, of_rates])
            variance += [rest.w_variance for rest in rests for _ in range(3)]
        return Observations(r, J, np.diag(variance), -a / length[:, None], None, 0.0)
