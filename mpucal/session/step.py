"""Steps of a session, and what those that ask for orientations share: pauses, for which the board is held still."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import Samples, Vector
from ..rests.limits import HAND, UNTOUCHED
from ..rests.stillness import Detector, Still
from ..rests.windows import Windows
from .aims import directions
from .boards import describe, describe_tilt
from .coverage import DISTINCT_RAD, Directions
from .events import (
    Caution,
    Checked,
    Countdown,
    Direction,
    Finished,
    Held,
    Learnt,
    Output,
    Prompt,
    PromptKind,
    Rested,
    Stopped,
    Tried,
    Turned,
    Use,
    down_of,
    triple,
)
from .plan import Plan

# Events that end a step; such an event comes last in its outputs.
End = Rested | Turned | Finished | Stopped
ENOUGH = "you chose to go on"
# Least time between two cautions of one kind.
SAY_AGAIN_S = 5.0


class Step:
    """Step of a session.

    Attributes
    ----------
    prompt : the last one. checked : result of the verification; None before it is known, or if the person skipped it.
    """

    prompt = Prompt(PromptKind.REST, "")
    checked: Checked | None = None

    @property
    def wanted(self) -> Direction | None:
        """Unit vector that is to point down; None if no orientation is asked for."""
        return self.prompt.down

    def begin(self) -> Sequence[Output]:
        """Return the first outputs."""
        return [self.prompt]

    def add(self, samples: Samples) -> Sequence[Output | End]:
        """Return the outputs for `samples`."""
        raise NotImplementedError

    def answer(self, event: Learnt | Tried | Checked) -> Sequence[Output | End]:
        """Return the outputs for the answer of a fit; none if another step requested it."""
        return []

    def enough(self) -> Sequence[End]:
        """Return the end of the step at the person's wish, if there is enough to go on with."""
        return [Finished(ENOUGH)]

    def resumed(self) -> Sequence[Output]:
        """Start again after a gap, in which the board may have been moved."""
        return [self.prompt]


# Length of a window for the rests of a hand, which are short.
HAND_WINDOW_S = 0.25
# From the prompt for the next orientation until a person moves there is another second of stillness.
HOLD_S = 1.25
# A vehicle that is put down is left there for longer: no tremor moves its readings over the steps of its streams. The
# newest windows show that nobody touches it.
PLACED_S, NEWEST = 3.0, 2
# The prompt is repeated after this time without a new orientation.
REMIND_S = 8.0
# Rests, turnings and questions end after this time without progress; a check and a verification after the second one.
PATIENCE_S, VERIFY_PATIENCE_S = 60.0, 40.0
# Session time after which the answer of a fit is taken.
WAIT_S = 0.5
# A board this near to the wanted orientation is in it; a person who holds it this near meant that orientation.
WANTED_RAD, MEANT_RAD = math.radians(15.0), math.radians(25.0)
USE_TEXTS = {
    Use.TAKEN: "taken",
    Use.USEFUL: "not the one asked for, but useful",
    Use.SEEN: "seen already",
}


@dataclass(frozen=True)
class Pause:
    """The board has been still in one orientation for `seconds`; `run` numbers the stillnesses.

    Attributes
    ----------
    acc : (3,) mean acceleration [m/s^2]. hold_s : time for which it is to be held, longer where nobody touches it.
    countdown : to the end of the hold; None once that is past.
    """

    t_s: float
    seconds: float
    acc: Vector
    run: int
    hold_s: float = HOLD_S
    countdown: Countdown | None = None


def is_near(acc: Vector, wanted: Direction | None, near_rad: float) -> bool:
    """Return True if the mean acceleration (3,) of a pause is within `near_rad` of the wanted orientation."""
    return wanted is not None and math.acos(max(min(float(np.dot(down_of(acc), wanted)), 1.0), -1.0)) <= near_rad


def classify_use(acc: Vector, wanted: Direction | None, new: bool) -> Use:
    """Return the use of a pause with the mean acceleration `acc` (3,), in an orientation that is `new` or not."""
    if is_near(acc, wanted, WANTED_RAD):
        return Use.TAKEN
    return Use.USEFUL if new else Use.SEEN


def held(pause: Pause, use: Use) -> Held:
    """Return the output for a pause that was long enough."""
    return Held(pause.t_s, use, down_of(pause.acc), USE_TEXTS[use])


def countdown(pause: Pause, use: Use) -> list[Countdown]:
    """Return the countdown of a pause, if its orientation is of use."""
    if pause.countdown is None or use is Use.SEEN:
        return []
    return [replace(pause.countdown, elsewhere=use is Use.USEFUL)]


class PoseStep(Step):
    """Base of the steps that ask for one orientation after another.

    Parameters
    ----------
    flat : the flat rest. plan : settings of the session. hold_s, placed_s : see PauseDetector.
    """

    def __init__(self, flat: Rested, plan: Plan, hold_s: float = HOLD_S, placed_s: float | None = None) -> None:
        self._plan = plan
        self._pauses = PauseDetector(flat, hold_s, placed_s)
        self._directions = directions(down_of(np.array(flat.acc)), plan.tilt_only)
        self._begun_s: float | None = None
        self._prompted_s = 0.0

    def resumed(self) -> Sequence[Output]:
        """See Step."""
        self._begun_s = None
        self._pauses.forget()
        return super().resumed()

    def _farthest(self, seen: Directions) -> Vector:
        """Return the direction farthest from all `seen`, at least DISTINCT_RAD from the one that is asked for."""
        others = self._directions
        if self.prompt.down is not None:
            others = others[others @ np.array(self.prompt.down) < math.cos(DISTINCT_RAD)]
        return seen.farthest_down(others)

    def _ask_for(self, kind: PromptKind, down: Vector, text: str) -> Prompt:
        """Return the prompt to point `down` (3,) down; the words for the orientation replace {} in `text`."""
        words = (describe_tilt if self._plan.tilt_only else describe)(triple(down), self._plan.board)
        return Prompt(kind, text.format(words), triple(down))

    def _remind(self, t_s: float, since_s: float, what: str) -> list[Output]:
        """Return the prompt as a caution, if it is REMIND_S since the last one and since `since_s`."""
        if t_s - max(since_s, self._prompted_s) < REMIND_S:
            return []
        self._prompted_s = t_s
        return [Caution(t_s, "not_turned", what, self.prompt.text)]


class PauseDetector:
    """Detector of pauses; the stillness in which it begins does not count.

    Parameters
    ----------
    flat : the flat rest, which gives the gyroscope's bias. hold_s : time for which each orientation is to be held.
    placed_s : the same where nobody touches the board; None: `hold_s`.
    """

    def __init__(self, flat: Rested, hold_s: float = HOLD_S, placed_s: float | None = None) -> None:
        self._hold_s, self._placed_s = hold_s, placed_s or hold_s
        silent = np.zeros(3)
        self._hands = Detector(UNTOUCHED, (silent, silent), bias=np.array(flat.gyr))
        self._touched: deque[bool] = deque(maxlen=NEWEST)
        self._windows = Windows(HAND_WINDOW_S)
        self._stillness = Detector(HAND, bias=np.array(flat.gyr), learns=True)
        self._last_run: int | None = None

    def leave(self, run: int) -> None:
        """Ignore the stillness number `run` from now on."""
        self._last_run = run

    def forget(self) -> None:
        """Reset after a discontinuity."""
        self._stillness.forget()

    def add(self, samples: Samples) -> list[Pause]:
        """Return the pauses that `samples` show, one for each window of stillness."""
        pauses: list[Pause] = []
        for window in self._windows.add(samples):
            sight = self._stillness.add(window)
            self._touched.append(float(self._hands.shares(window).level) > 1.0)
            if self._last_run is None:
                self._last_run = sight.run if isinstance(sight, Still) else -1
            if not isinstance(sight, Still) or sight.run <= self._last_run:
                continue
            hold_s, remaining = self._hold_s if any(self._touched) else self._placed_s, None
            if sight.seconds < hold_s + HAND_WINDOW_S - 1e-6:
                remaining = Countdown(window.end_s, max(hold_s - sight.seconds, 0.0), hold_s, paused=False)
            acc = np.asarray(sight.acc)
            pauses.append(Pause(window.end_s, sight.seconds, acc, sight.run, hold_s, remaining))
        return pauses
