"""Meter of the board's motion, 4 times a second, and cautions about turning too fast, clipping and lost samples."""

from __future__ import annotations

import math

import numpy as np

from ..data import Samples, Sensor
from ..rests.limits import HAND
from ..rests.stillness import Detector, Moved
from ..rests.windows import Window, Windows
from .attitude import Attitude, canonical
from .events import Caution, Direction, Meter, Output, down_of
from .step import SAY_AGAIN_S
from .turn_guide import TurnGuide

WINDOW_S = 0.25
NEAR_RANGE = 0.8


class MotionWatch:
    """Source of Meter and Caution in every step.

    Parameters
    ----------
    sensor : its ranges decide about cautions.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._windows = Windows(WINDOW_S)
        self._stillness = Detector(HAND)
        self._attitude, self._guide = Attitude(), TurnGuide()
        self._still = False
        self._last_s: dict[str, float] = {}
        self._temperature_c: float | None = None

    def flat(self) -> None:
        """End the flat rest: the gyroscope's bias is known from now on."""
        bias = self._stillness.rest_rad_s
        self._attitude.flat(bias)
        self._stillness = Detector(HAND, bias=bias, learns=True)

    def add(self, samples: Samples, wanted: Direction | None = None) -> list[Output]:
        """Return the outputs for `samples`; `wanted` : unit vector of the board's axes that is to point down."""
        self._attitude.add(samples, self._still, self._stillness.rest_rad_s)
        t_s = float(samples.t[-1])
        cautions = [caution for caution in self._cautions(samples, t_s) if self._is_due(caution)]
        known = samples.temperature_c[np.isfinite(samples.temperature_c)]
        if len(known):
            self._temperature_c = float(known[-1])
        return [*cautions, *(self._meter(window, wanted) for window in self._windows.add(samples))]

    def _meter(self, window: Window, wanted: Direction | None) -> Meter:
        sight = self._stillness.add(window)
        moving = isinstance(sight, Moved)
        self._still = not moving
        turn = None if wanted is None else self._guide.turn_to(wanted, self._attitude.now)
        # The mean of the last stillness is the gyroscope's bias.
        turning = float(np.linalg.norm(window.gyr - self._stillness.rest_rad_s))
        return Meter(
            window.end_s,
            self._stillness.level,
            not moving,
            sight.what if isinstance(sight, Moved) else "",
            down_of(window.acc),
            math.degrees(turning),
            window.count / (window.end_s - window.start_s),
            self._temperature_c,
            canonical(self._attitude.now),
            turn.missing_deg if turn else None,
            turn.words if turn else "",
            canonical(turn.attitude) if turn else None,
        )

    def _cautions(self, samples: Samples, t_s: float) -> list[Caution]:
        cautions = []
        limit = self._sensor.gyro_range_dps
        in_words = f"the gyroscope's range of {limit:.0f} deg/s" if limit else "the gyroscope's range"
        fastest = math.degrees(float(np.abs(samples.gyr).max()))
        if samples.gyr_clipped.any():
            cautions.append(Caution(t_s, "clipped", f"turned faster than {in_words}", "turn it more slowly"))
        elif limit and fastest > NEAR_RANGE * limit:
            what = f"turned at {fastest:.0f} deg/s, close to {in_words}"
            cautions.append(Caution(t_s, "too_fast", what, "turn it more slowly"))
        if samples.acc_clipped.any():
            what = "a shock exceeded the accelerometer's range"
            cautions.append(Caution(t_s, "knocked", what, "handle the board gently, and set it down softly"))
        if samples.gap.any():
            cautions.append(Caution(t_s, "data_lost", "samples were lost", "hold this orientation a moment longer"))
        return cautions

    def _is_due(self, caution: Caution) -> bool:
        last = self._last_s.get(caution.code)
        if last is not None and caution.t_s - last < SAY_AGAIN_S:
            return False
        self._last_s[caution.code] = caution.t_s
        return True
