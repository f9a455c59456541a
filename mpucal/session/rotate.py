"""The second step of a session: the board is turned through enough orientations. Knows no other step."""

from __future__ import annotations

import numpy as np

from ..data import Samples, Vector
from .coverage import PAUSES, Count, Coverage
from .events import Direction, Output, Progress, Prompt, PromptKind, Turned
from .stillness import AXES, IN_THE_HAND, Still, Stillness
from .windows import Window, Windows

PAUSE_WINDOW_S = 0.25
PASS_WINDOW_S = 0.1
# So long in one orientation is a pause.
PAUSE_S = 1.0
PATIENCE_S = 60.0
# Beyond these the hand's own acceleration hides where gravity is [m/s^2].
LEAST_MPS2, MOST_MPS2 = 5.0, 15.0
# An axis is worth naming in a hint where this much of gravity is to lie along it.
WORTH_NAMING = 0.4

PROMPT = Prompt(
    PromptKind.ROTATE,
    f"Now turn it through {PAUSES} different orientations, tilted ones too, and hold each for two seconds.",
)


class Rotate:
    """Counts orientations until there are enough, or until no new one comes.

    Parameters
    ----------
    flat : mean acceleration while the board lay flat [m/s^2]: the first orientation.
    until_end : go on until the source ends, however many there are.
    """

    def __init__(self, flat: Direction, until_end: bool = False) -> None:
        self._until_end = until_end
        self._pause_windows, self._pass_windows = Windows(PAUSE_WINDOW_S), Windows(PASS_WINDOW_S)
        self._stillness = Stillness(IN_THE_HAND)
        self._coverage = Coverage()
        self._coverage.pauses(np.array(flat))
        self._coverage.passes(np.array(flat))
        self._count = self._coverage.count()
        self._new_s: float | None = None

    def add(self, samples: Samples) -> list[Output | Turned]:
        """What `samples` show; Turned comes last and ends the step."""
        for window in self._pass_windows.add(samples):
            if window.whole and LEAST_MPS2 < np.linalg.norm(window.acc) < MOST_MPS2:
                self._note(self._coverage.passes(window.acc), window.end_s)
        found: list[Output | Turned] = []
        for window in self._pause_windows.add(samples):
            self._pause(window)
            self._count = self._coverage.count()
            found.append(Progress(window.end_s, self._count.done, self._count.of, _words(self._count)))
            turned = None if self._until_end else self._turned(window.end_s)
            if turned:
                return [*found, turned]
        return found

    def _pause(self, window: Window) -> None:
        sight = self._stillness.add(window)
        if isinstance(sight, Still) and sight.seconds >= PAUSE_S - 1e-6:
            self._note(self._coverage.pauses(sight.acc), window.end_s)

    def _note(self, is_new: bool, t_s: float) -> None:
        if is_new or self._new_s is None:
            self._new_s = t_s

    def _turned(self, t_s: float) -> Turned | None:
        if self._count.enough:
            return Turned("the orientations are enough")
        if self._new_s is not None and t_s - self._new_s >= PATIENCE_S:
            return Turned(
                f"no new orientation for {PATIENCE_S:.0f} s, {self._count.done} of {self._count.of} are there"
            )
        return None


def _words(count: Count) -> str:
    words = f"orientation {count.done} of {count.of}"
    return words if count.enough else f"{words}; one that helps: {_attitude(count.wanted)}"


def _attitude(up: Vector) -> str:
    """How to hold the board so that `up` (3,) points up, in words about its axes."""
    named = [i for i in np.argsort(-np.abs(up), kind="stable") if abs(up[i]) >= WORTH_NAMING]
    return ", ".join(f"{AXES[i]} {'up' if up[i] > 0 else 'down'}" for i in named)
