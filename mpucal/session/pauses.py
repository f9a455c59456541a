"""Pauses of a board in a hand: when it has been held still in one orientation for long enough."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..data import Samples, Vector
from ..rests.limits import HAND
from ..rests.stillness import Detector, Still
from ..rests.windows import Windows
from .events import Countdown, Direction, Held, Rested, Use

WINDOW_S = 0.25
# From the prompt for the next orientation until a person moves there is another second of stillness.
HOLD_S = 1.25
# So near to the wanted orientation the board is in it.
WANTED_RAD = math.radians(15.0)
SAID = {
    Use.TAKEN: "taken",
    Use.USEFUL: "not that one, but useful",
    Use.SEEN: "seen already",
}


@dataclass(frozen=True)
class Pause:
    """The board has been still in one orientation for `seconds`; `run` numbers the stillnesses.

    Attributes
    ----------
    acc : (3,) its mean acceleration [m/s^2]. countdown : to the end of the hold; None once that is past.
    """

    t_s: float
    seconds: float
    acc: Vector
    run: int
    countdown: Countdown | None = None


def use_of(acc: Vector, wanted: Direction | None, new: bool, near_rad: float = WANTED_RAD) -> Use:
    """Of what use a pause with the mean acceleration `acc` (3,) is, in an orientation that is `new` or not.

    It is the wanted one where it is no farther from it than `near_rad`.
    """
    if wanted is not None:
        share = float(-acc @ np.asarray(wanted)) / max(float(np.linalg.norm(acc)), 1e-9)
        if share >= math.cos(near_rad):
            return Use.TAKEN
    return Use.USEFUL if new else Use.SEEN


def held(pause: Pause, use: Use) -> Held:
    """What is said of it."""
    x, y, z = (-pause.acc / max(float(np.linalg.norm(pause.acc)), 1e-9)).tolist()
    return Held(pause.t_s, use, (x, y, z), SAID[use])


def counted(pause: Pause, use: Use) -> list[Countdown]:
    """The countdown of a pause, where its orientation is of use."""
    if pause.countdown is None or use is Use.SEEN:
        return []
    return [replace(pause.countdown, elsewhere=use is Use.USEFUL)]


class Pauses:
    """Follows the stillnesses of a board in a hand, each held for `hold_s`; the one that it begins in is left out.

    flat : how it lay before, by which the gyroscope's bias is known.
    """

    def __init__(self, flat: Rested, hold_s: float = HOLD_S) -> None:
        self._hold_s = hold_s
        self._windows = Windows(WINDOW_S)
        self._stillness = Detector(HAND, bias=np.array(flat.gyr), learns=True)
        self._left: int | None = None

    def leave(self, run: int) -> None:
        """That stillness is done with: the next one counts."""
        self._left = run

    def forget(self) -> None:
        """What comes next has nothing to do with what was."""
        self._stillness.forget()

    def add(self, samples: Samples) -> list[Pause]:
        """What `samples` show, a window at a time."""
        found: list[Pause] = []
        for window in self._windows.add(samples):
            sight = self._stillness.add(window)
            if self._left is None:
                self._left = sight.run if isinstance(sight, Still) else -1
            if not isinstance(sight, Still) or sight.run <= self._left:
                continue
            countdown = None
            if sight.seconds < self._hold_s + WINDOW_S - 1e-6:
                remaining = max(self._hold_s - sight.seconds, 0.0)
                countdown = Countdown(window.end_s, remaining, self._hold_s, paused=False)
            found.append(Pause(window.end_s, sight.seconds, np.asarray(sight.acc), sight.run, countdown))
        return found
