"""The second step of a session: ask for orientations until the target uncertainty is reached."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..data import Samples, Vector
from ..rests.windows import Window, Windows
from ..result.orientation import side_down, tilt_down
from .aims import Aim, directions
from .coverage import DISTINCT_RAD, Coverage
from .events import (
    Ask,
    Caution,
    Direction,
    Knowledge,
    Output,
    Progress,
    Prompt,
    PromptKind,
    Rested,
    Seen,
    Turned,
    Use,
    Wish,
)
from .pauses import HOLD_S, Pause, Pauses, counted, held, use_of

PASS_WINDOW_S = 0.1
# So long in one orientation is a pause.
PAUSE_S = 1.0
# A fit uses shorter ones, too.
REST_S = 0.5
PATIENCE_S = 60.0
# Of nine that may be asked for, a sloppy hand makes so many different ones.
TILTS = 6
# Said again where nothing new was shown for so long.
SAY_AGAIN_S = 8.0
# Beyond these the hand's own acceleration hides where gravity is [m/s^2].
LEAST_MPS2, MOST_MPS2 = 5.0, 15.0

# How often what is known is looked at (after a long time, less), and how long the session lets a fit take.
KNOW_EVERY_S = TELL_EVERY_S = 1.0
# Where nothing is asked for, it is only shown.
SHOW_EVERY_S = 5.0
SELDOM = 40.0
WAIT_S = 0.5


class Rotate:
    """Asks for one orientation after the other, until the target is reached.

    Parameters
    ----------
    flat : how the board lay: the first orientation.
    aim : what is wanted. until_end : go on until the source ends, and ask for nothing.
    tilt_only : ask for small tilts from flat alone.
    """

    def __init__(self, flat: Rested, aim: Aim, until_end: bool = False, tilt_only: bool = False) -> None:
        self.flat, self._aim, self._until_end, self._tilt_only = flat, aim, until_end, tilt_only
        self._least = TILTS if tilt_only else aim.least
        self._pauses, self._passes = Pauses(flat), Windows(PASS_WINDOW_S, spread=False)
        self.coverage = Coverage()
        acc = np.array(flat.acc)
        self.coverage.pauses(acc)
        self.coverage.passes(acc)
        self.coverage.rests(acc)
        x, y, z = (-acc / np.linalg.norm(acc)).tolist()
        self.directions = directions((x, y, z), tilt_only)
        self._knowledge: Knowledge | None = None
        self._asked = False
        self._advised_run = -1
        self._held: tuple[Pause, Use] | None = None
        self._begun_s: float | None = None
        self._t_s = self._new_s = self._known_s = self._told_s = self._said_s = 0.0
        self.prompt = self._prompt_for(self.coverage.farthest_down(self.directions))

    def add(self, samples: Samples) -> list[Output | Turned]:
        """What `samples` show; Turned comes last and ends the step."""
        if self._begun_s is None:
            self._begun_s = self._new_s = self._known_s = self._told_s = self._said_s = float(samples.t[0])
        for window in self._passes.add(samples):
            self._pass(window)
        found: list[Output | Turned] = []
        for pause in self._pauses.add(samples):
            found += self._hold(pause)
        self._t_s = t_s = float(samples.t[-1])
        found += self._at(t_s)
        turned = None if self._until_end else self._turned(t_s)
        return [*found, turned] if turned else found

    def learn(self, knowledge: Knowledge, advice: bool) -> list[Output | Turned]:
        """What is known by now; Turned comes last and ends the step."""
        self._knowledge, self._asked = knowledge, False
        found: list[Output | Turned] = [knowledge]
        if self._until_end:
            return found
        if advice and self._held is not None:
            # said now, and not when it was counted: the time is that of the samples
            found.append(replace(held(*self._held), t_s=self._t_s))
        if self._content():
            # tilts leave some parameters at their prior: the target does not apply to them
            what = "enough tilts seen" if self._tilt_only else "target reached"
            return [*found, Turned(f"{what}: {knowledge.words}")]
        if advice and knowledge.down is not None:
            self._said_s = knowledge.t_s
            # near level every tilt teaches: all of them are asked for. And nobody is asked twice for the same one, even
            # by an estimate that takes up for down, as that of a sensor whose axes are mirrored
            elsewhere = self._tilt_only or knowledge.down == self.prompt.down
            self.prompt = self._prompt_for(self._elsewhere() if elsewhere else np.array(knowledge.down))
            found.append(self.prompt)
        return found

    @property
    def wanted(self) -> Direction | None:
        """What is to point down; where nothing is asked for, what would teach most."""
        if self.prompt.down is not None or self._knowledge is None:
            return self.prompt.down
        return self._knowledge.down

    def _elsewhere(self) -> Vector:
        """(3,) what is least like all that was shown, and not what was asked for last."""
        last = np.array(self.prompt.down)
        return self.coverage.farthest_down(self.directions[self.directions @ last < math.cos(DISTINCT_RAD)])

    def resumed(self) -> list[Output]:
        """The board may be anywhere now."""
        self._asked, self._begun_s = False, None
        self._pauses.forget()
        return [] if self._until_end else [self.prompt]

    def _pass(self, window: Window) -> None:
        if window.whole and LEAST_MPS2 < np.linalg.norm(window.acc) < MOST_MPS2 and self.coverage.passes(window.acc):
            self._new_s = window.end_s

    def _hold(self, pause: Pause) -> list[Output | Turned]:
        # what has been counted is not new any more
        if self._held is None or self._held[0].run != pause.run or pause.seconds < PAUSE_S - 1e-6:
            self._held = pause, use_of(pause.acc, self.prompt.down, self.coverage.is_new(pause.acc))
        # what was said of it ends its countdown, also where a bump held that up
        told = pause.run <= self._advised_run and not self._asked
        found: list[Output | Turned] = [] if told else [*counted(pause, self._held[1])]
        if pause.seconds >= REST_S - 1e-6:
            self.coverage.rests(pause.acc)
        if pause.seconds >= PAUSE_S - 1e-6 and self.coverage.pauses(pause.acc):
            self._new_s = pause.t_s
            found.append(Seen(pause.t_s, len(self.coverage.paused), _down(pause.acc), paused=True))
        if self._until_end or self._asked or pause.run <= self._advised_run:
            return found
        if pause.seconds >= HOLD_S - WAIT_S - 1e-6:
            self._asked, self._advised_run, self._known_s = True, pause.run, pause.t_s
            found.append(Ask(Wish.ADVISE, WAIT_S))
        return found

    def _at(self, t_s: float) -> list[Output]:
        found: list[Output] = []
        turning_s = t_s - (self._begun_s or t_s)
        every_s = SHOW_EVERY_S if self._until_end else max(KNOW_EVERY_S, turning_s / SELDOM)
        if not self._asked and t_s - self._known_s >= every_s:
            self._asked, self._known_s = True, t_s
            found.append(Ask(Wish.KNOW, WAIT_S))
        if t_s - self._told_s >= TELL_EVERY_S:
            self._told_s = t_s
            number = self.coverage.number
            more = f"orientation {number} of {self._least}"
            enough = f"{number} orientations, of at least {self._least}"
            said = more if number <= self._least else enough
            found.append(Progress(t_s, min(number, self._least), self._least, said))
        if not self._until_end and t_s - max(self._new_s, self._said_s) >= SAY_AGAIN_S:
            self._said_s = t_s
            found.append(Caution(t_s, "not_turned", "no new orientation for a while", self.prompt.text))
        return found

    def _content(self) -> bool:
        if self.coverage.number < self._least or self._tilt_only:
            return self.coverage.number >= self._least
        return self.coverage.varied and self._knowledge is not None and self._knowledge.overall >= 1.0

    def _turned(self, t_s: float) -> Turned | None:
        known = f": {self._knowledge.words}" if self._knowledge else ""
        if t_s - self._new_s >= PATIENCE_S:
            return Turned(f"no new orientation for {PATIENCE_S:.0f} s, {self.coverage.number} seen{known}")
        if self._begun_s is not None and t_s - self._begun_s >= self._aim.longest_s:
            return Turned(f"time limit of {self._aim.longest_s:.0f} s for turning reached{known}")
        return None

    def _prompt_for(self, down: Vector) -> Prompt:
        x, y, z = down.tolist()
        if self._until_end:
            text = "Turn the board through many different orientations, tilted ones too, and hold each for 2 s."
            return Prompt(PromptKind.ROTATE, text)
        side = tilt_down(down) if self._tilt_only else f"{side_down(down)} down"
        return Prompt(PromptKind.ROTATE, f"Turn the board: {side}, then hold it still.", (x, y, z))


def _down(acc: Vector) -> Direction:
    x, y, z = (-acc / max(float(np.linalg.norm(acc)), 1e-9)).tolist()
    return (x, y, z)
