"""Meter of the board's motion, 4 times a second: the turn to the wanted orientation, and cautions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..data import Samples, Sensor, Vector
from ..rests.limits import HAND
from ..rests.stillness import Detector, Moved, Sighting
from ..rests.windows import Windows
from .attitude import Attitude, canonical, compose, from_vector, rotate, turned_up, yaw_between
from .events import LAID, Caution, Direction, Meter, Output, Quaternion, down_of
from .step import HAND_WINDOW_S, SAY_AGAIN_S

NEAR_RANGE = 0.8


class MotionWatch:
    """Source of Meter and Caution in every step, and of the sightings in which a step finds pauses.

    Parameters
    ----------
    sensor : its ranges decide about cautions.

    Attributes
    ----------
    sightings : the windows that the last samples completed.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._windows, self._stillness = Windows(HAND_WINDOW_S), Detector(HAND)
        self.sightings: list[Sighting] = []
        self._attitude, self._guide = Attitude(), TurnGuide()
        self._still = False
        self._last_s: dict[str, float] = {}
        self._temperature_c: float | None = None

    def flat(self) -> None:
        """End the flat rest: from now on the gyroscope carries the heading."""
        self._attitude.flat(self._stillness.rest_rad_s)

    def begin(self, bias: Vector) -> None:
        """Begin a step that asks for orientations; `bias` (3,) rad/s: the gyroscope's, by the flat rest."""
        self._windows, self._stillness = Windows(HAND_WINDOW_S), Detector(HAND, bias=bias, learns=True)

    def forget(self) -> None:
        """Forget what was seen before a gap, in which the board may have been moved."""
        self._stillness.forget()

    def add(self, samples: Samples, wanted: Direction | None = None) -> list[Output]:
        """Return the outputs for `samples`; `wanted` : unit vector of the board's axes that is to point down."""
        self._attitude.add(samples, self._still, self._stillness.rest_rad_s)
        t_s = float(samples.t[-1])
        cautions = [caution for caution in self._cautions(samples, t_s) if self._is_due(caution)]
        known = samples.temperature_c[np.isfinite(samples.temperature_c)]
        if len(known):
            self._temperature_c = float(known[-1])
        self.sightings, meters = [], []
        for window in self._windows.add(samples):
            self.sightings.append(Sighting(window, self._stillness.add(window)))
            meters.append(self._meter(self.sightings[-1], wanted))
        return [*cautions, *meters]

    def _meter(self, sighting: Sighting, wanted: Direction | None) -> Meter:
        window, sight = sighting
        moving = isinstance(sight, Moved)
        self._still = not moving
        turn = NO_TURN if wanted is None else self._guide.turn_to(wanted, self._attitude.now)
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
            *turn,
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


# The eight directions in which the board's top can be turned, anticlockwise from the right as seen from above.
TURN_WORDS = (
    "roll it to the right",
    "tip it away and right",
    "tip it away from you",
    "tip it away and left",
    "roll it to the left",
    "tip it toward you and left",
    "tip it toward you",
    "tip it toward you and right",
)
ROUND_DEG = 5.0
# A heading is kept as long as it leads this near to the wanted orientation.
KEPT_RAD = math.radians(10.0)
# The words are kept as long as the heading differs from theirs by no more than this. For turns of less than a right
# angle that is the shortest heading: after a turn of 25 deg in a direction that is 60 deg off, 25 deg would remain.
WORDS_KEPT_RAD = math.radians(30.0)
# From one call to the next the wanted attitude turns about the vertical by no more than this.
SLEW_RAD = math.radians(15.0)


class Turn(NamedTuple):
    """Turn to a wanted orientation: its angle, its words, and the attitude that it leads to."""

    missing_deg: float | None = None
    words: str = ""
    attitude: Quaternion | None = None


NO_TURN = Turn()


class TurnGuide:
    """Guide to one orientation after another.

    The guide keeps the heading that it has chosen. Where nearly half a turn is missing, all headings are about equally
    short, and each tremor would make another one the shortest.
    """

    def __init__(self) -> None:
        self._to: Direction | None = None
        self._heading = 0.0
        self._word_index = 0
        self._wanted = LAID

    def turn_to(self, down: Direction, attitude: Quaternion) -> Turn:
        """Return the turn of a board with this attitude that points the unit vector `down` of its axes down."""
        new = down != self._to
        x, y, z = rotate(attitude, down)
        missing = math.atan2(math.hypot(x, y), -z)
        self._update_heading(math.atan2(y, x), missing, new)
        # The turn's axis is horizontal, and at right angles to the heading of the top.
        along_x, along_y = math.cos(self._heading), math.sin(self._heading)
        turn = math.atan2(x * along_x + y * along_y, -z)
        turned = compose(from_vector(-turn * along_y, turn * along_x, 0.0), attitude)
        wanted = turned_up(turned, (-down[0], -down[1], -down[2]))
        if not new:
            slew = min(max(yaw_between(wanted, self._wanted), -SLEW_RAD), SLEW_RAD)
            wanted = compose(from_vector(0.0, 0.0, slew), self._wanted)
        self._to, self._wanted = down, wanted
        rounded = ROUND_DEG * round(math.degrees(missing) / ROUND_DEG)
        words = f"{rounded:.0f} deg more, {TURN_WORDS[self._word_index]}" if rounded else ""
        return Turn(math.degrees(missing), words, canonical(wanted))

    def _update_heading(self, shortest: float, missing: float, new: bool) -> None:
        """Change the heading no more than is needed to end within KEPT_RAD of the wanted orientation."""
        if new:
            # For half a turn any heading will do, and one of the four simple ones is easy to follow.
            simple = missing > math.pi - KEPT_RAD
            self._heading = _angle(2 * round(shortest / (math.pi / 2.0)) if simple else _nearest(shortest))
        aside = _wrapped(self._heading - shortest)
        if abs(aside) > math.pi / 2.0 and missing < math.pi - KEPT_RAD:
            aside = _wrapped(aside + math.pi)
        reach = math.sin(KEPT_RAD) / max(math.sin(missing), 1e-9)
        most = math.asin(reach) if reach < 1.0 else math.pi
        self._heading = shortest + min(max(aside, -most), most)
        shown = self._heading if missing > math.pi / 2.0 else shortest
        if new or abs(_wrapped(shown - _angle(self._word_index))) > WORDS_KEPT_RAD:
            self._word_index = _nearest(shown)


def _nearest(heading: float) -> int:
    return round(heading / (math.pi / 4.0)) % len(TURN_WORDS)


def _angle(index: int) -> float:
    return index * math.pi / 4.0


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
