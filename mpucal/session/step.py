"""Steps of a session, and what those that ask for orientations share: pauses, for which the board is held still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data import Samples, Vector
from ..rests.limits import LEAST_TURN_RAD
from ..rests.stillness import Sighting, Still
from . import events
from .aims import Directions, directions
from .boards import describe, describe_tilt
from .plan import Plan

ENOUGH = "you chose to go on"
# Least time between two cautions of one kind.
SAY_AGAIN_S = 5.0


class Step:
    """Step of a session.

    Attributes
    ----------
    prompt : the last one. checked : result of the verification; None before it is known, or if the person skipped it.
    """

    prompt = events.Prompt(events.PromptKind.REST, "")
    checked: events.Checked | None = None

    @property
    def wanted(self) -> events.Direction | None:
        """Unit vector that is to point down; None if no orientation is asked for."""
        return self.prompt.down

    def begin(self) -> Sequence[events.Output]:
        """Return the first outputs."""
        return [self.prompt]

    def add(self, samples: Samples, sightings: Sequence[Sighting]) -> events.Outputs:
        """Return the outputs for `samples`, and for the short windows that they complete."""
        raise NotImplementedError

    def answer(self, event: events.Answer) -> events.Outputs:
        """Return the outputs for the answer of a fit; none if another step requested it."""
        return []

    def enough(self) -> events.Outputs:
        """Return the end of the step at the person's wish, if there is enough to go on with."""
        return [events.Finished(ENOUGH)]

    def resumed(self) -> Sequence[events.Output]:
        """Start again after a gap, in which the board may have been moved."""
        return [self.prompt]


# Length of a window for the rests of a hand, which are short.
HAND_WINDOW_S = 0.25
# Time for which an orientation is held. It is followed by another second of stillness, until the person moves after the
# next prompt.
HOLD_S = 1.25
# The prompt is repeated after this time without a new orientation.
REMIND_S = 8.0
# Rests, turnings and questions end after this time without progress; a check and a verification after the second one.
PATIENCE_S, VERIFY_PATIENCE_S = 60.0, 40.0
# Session time after which the answer of a fit is taken.
WAIT_S = 0.5
# A board this near to the wanted orientation is in it; a person who holds it this near meant that orientation.
WANTED_RAD, MEANT_RAD = math.radians(15.0), math.radians(25.0)
USE_TEXTS = {
    events.Use.TAKEN: "taken",
    events.Use.USEFUL: "not the one asked for, but useful",
    events.Use.SEEN: "seen already",
}


class Pause(NamedTuple):
    """Pause in one orientation, which has lasted for `seconds`; `run` is the number of the still run, see Still.

    Attributes
    ----------
    acc : (3,) mean acceleration [m/s^2]. countdown : to the end of the hold; None once that is past.
    """

    t_s: float
    seconds: float
    acc: Vector
    run: int
    countdown: events.Countdown | None = None

    def is_near(self, wanted: events.Direction | None, near_rad: float) -> bool:
        """Return True if the board is within `near_rad` of the wanted orientation."""
        if wanted is None:
            return False
        return math.acos(max(min(float(np.dot(events.down_of(self.acc), wanted)), 1.0), -1.0)) <= near_rad

    def use(self, wanted: events.Direction | None, new: bool) -> events.Use:
        """Return the use of the pause, in an orientation that is `new` or not."""
        if self.is_near(wanted, WANTED_RAD):
            return events.Use.TAKEN
        return events.Use.USEFUL if new else events.Use.SEEN

    def held(self, use: events.Use) -> events.Held:
        """Return the output for a pause that was long enough."""
        return events.Held(self.t_s, use, events.down_of(self.acc), USE_TEXTS[use])

    def counting(self, use: events.Use) -> list[events.Countdown]:
        """Return the countdown, if the orientation is of use."""
        if self.countdown is None or use is events.Use.SEEN:
            return []
        return [self.countdown._replace(elsewhere=use is events.Use.USEFUL)]


class PoseStep(Step):
    """Base of the steps that ask for one orientation after another.

    Parameters
    ----------
    flat : the flat rest. plan : settings of the session. hold_s : time for which each orientation is to be held.
    """

    def __init__(self, flat: events.Rested, plan: Plan, hold_s: float = HOLD_S) -> None:
        self._plan = plan
        self._pauses = PauseDetector(hold_s)
        self._directions = directions(events.down_of(np.array(flat.acc)), plan.tilt_only)
        self._begun_s: float | None = None
        self._prompted_s = 0.0

    def resumed(self) -> Sequence[events.Output]:
        """See Step."""
        self._begun_s = None
        return super().resumed()

    def _farthest(self, seen: Directions) -> Vector:
        """Return the direction farthest from all `seen`, at least LEAST_TURN_RAD from the one that is asked for."""
        others = self._directions
        if self.prompt.down is not None:
            others = others[others @ np.array(self.prompt.down) < math.cos(LEAST_TURN_RAD)]
        return seen.farthest_down(others)

    def _ask_for(self, kind: events.PromptKind, down: Vector, text: str) -> events.Prompt:
        """Return the prompt to point `down` (3,) down; the words for the orientation replace {} in `text`."""
        words = (describe_tilt if self._plan.tilt_only else describe)(events.triple(down), self._plan.board)
        return events.Prompt(kind, text.format(words), events.triple(down))

    def _remind(self, t_s: float, since_s: float, what: str) -> list[events.Output]:
        """Return the prompt as a caution, if it is REMIND_S since the last one and since `since_s`."""
        if t_s - max(since_s, self._prompted_s) < REMIND_S:
            return []
        self._prompted_s = t_s
        return [events.Caution(t_s, "not_turned", what, self.prompt.text)]


class PauseDetector:
    """Detector of pauses; a still run that has begun before the detector does not count.

    Parameters
    ----------
    hold_s : time for which each orientation is to be held.
    """

    def __init__(self, hold_s: float = HOLD_S) -> None:
        self._hold_s = hold_s
        self._last_run: int | None = None

    def leave(self, run: int) -> None:
        """Ignore the still run of this number from now on."""
        self._last_run = run

    def add(self, sightings: Sequence[Sighting]) -> list[Pause]:
        """Return the state of the pause after each still window."""
        pauses: list[Pause] = []
        for window, sight in sightings:
            if self._last_run is None:
                self._last_run = sight.run if isinstance(sight, Still) else -1
            if not isinstance(sight, Still) or sight.run <= self._last_run:
                continue
            remaining = None
            if sight.seconds < self._hold_s + HAND_WINDOW_S - 1e-6:
                left_s = max(self._hold_s - sight.seconds, 0.0)
                remaining = events.Countdown(window.end_s, left_s, self._hold_s, paused=False)
            acc = np.asarray(sight.acc)
            pauses.append(Pause(window.end_s, sight.seconds, acc, sight.run, remaining))
        return pauses
