"""Pauses of a board in a hand: when it has been held still in one orientation for long enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Samples, Vector
from .events import Countdown
from .stillness import IN_THE_HAND, Still, StillnessDetector
from .windows import Windows

WINDOW_S = 0.25
# From the prompt for the next orientation until a person moves there is another second of stillness.
HOLD_S = 1.25


@dataclass(frozen=True)
class Pause:
    """The board has been still in one orientation for `seconds`; `run` numbers the stillnesses.

    Attributes
    ----------
    acc : (3,) its mean acceleration [m/s^2].
    """

    t_s: float
    seconds: float
    acc: Vector
    run: int


class Pauses:
    """Follows the stillnesses of a board in a hand; the one that it begins in is left out."""

    def __init__(self) -> None:
        self._windows = Windows(WINDOW_S)
        self._stillness = StillnessDetector(IN_THE_HAND)
        self._left: int | None = None

    def leave(self, run: int) -> None:
        """That stillness is done with: the next one counts."""
        self._left = run

    def forget(self) -> None:
        """What comes next has nothing to do with what was."""
        self._stillness.forget()

    def add(self, samples: Samples) -> list[Pause | Countdown]:
        """What `samples` show, a window at a time."""
        found: list[Pause | Countdown] = []
        for window in self._windows.add(samples):
            sight = self._stillness.add(window)
            if self._left is None:
                self._left = sight.run if isinstance(sight, Still) else -1
            if not isinstance(sight, Still) or sight.run <= self._left:
                continue
            if sight.seconds < HOLD_S + WINDOW_S - 1e-6:
                remaining = max(HOLD_S - sight.seconds, 0.0)
                found.append(Countdown(window.end_s, remaining, HOLD_S, paused=False))
            found.append(Pause(window.end_s, sight.seconds, np.asarray(sight.acc), sight.run))
        return found
