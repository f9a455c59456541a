"""The third step of a session: check the first calibration in orientations that it has not seen."""

from __future__ import annotations

import math

import numpy as np

from ..data import Samples, Vector
from ..reasons import KINDS, Reason, reason
from ..result.orientation import side_down, tilt_down
from .aims import Aim, unseen_rad
from .coverage import DISTINCT_RAD, Coverage
from .events import (
    Ask,
    Caution,
    Checked,
    Direction,
    Finished,
    Output,
    Progress,
    Prompt,
    PromptKind,
    Rested,
    Tried,
    Use,
    Wish,
)
from .pauses import HOLD_S, Pause, Pauses, counted, held, use_of

PATIENCE_S = 40.0
SAY_AGAIN_S = 8.0
# A bias and scale factor errors bend directions by this much of them: raw ones are to be farther apart.
BENT = 1.1
# So near to what is asked for a hand meant to be there.
ASKED_FOR_RAD = math.radians(25.0)
# A whole calibration is computed while the first orientations are asked for ...
TRY_WAIT_S = 3.0
# ... and what the last one says of it is soon told.
CHECK_WAIT_S = 0.5
REFUSED = "refused"
OFFERED_S = 60.0
# how often another orientation is asked for in place of one that the calibration has seen after all
MOST_MORE = 2


class Verify:
    """Asks for `aim.verify` new orientations, and for what they say.

    Parameters
    ----------
    flat : how the board lay. coverage : what the turning has shown.
    directions : (k, 3) that may be asked to point down.
    attended : somebody can press keys, and is asked whether to turn it anew where that may help.

    Attributes
    ----------
    prompt : the last one. checked : what was found; None where that is still to come, or was not wanted.
    """

    def __init__(
        self,
        flat: Rested,
        aim: Aim,
        coverage: Coverage,
        directions: Vector,
        tilt_only: bool = False,
        attended: bool = False,
    ) -> None:
        self._aim, self._coverage, self._directions, self._tilt_only = aim, coverage, directions, tilt_only
        self._attended = attended
        self._refusal: Finished | None = None
        self._pauses = Pauses(flat)
        self._number = 0
        self._asked, self._more = False, MOST_MORE
        self._begun_s: float | None = None
        self._said_s = self._now_s = 0.0
        self.checked: Checked | None = None
        self.prompt = self._next()

    @property
    def wanted(self) -> Direction | None:
        """What is to point down."""
        return self.prompt.down

    def begin(self) -> list[Output]:
        """The first words."""
        return [Ask(Wish.TRY, TRY_WAIT_S), self.prompt]

    def add(self, samples: Samples) -> list[Output | Finished]:
        """What `samples` show; Finished comes last and ends the step."""
        t_s = self._now_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._said_s = t_s
        if self._refusal is not None:
            return [self._refusal] if t_s - self._begun_s >= OFFERED_S else []
        found: list[Output | Finished] = []
        for pause in self._pauses.add(samples):
            use = self._use(pause)
            found += [] if self._asked else counted(pause, use)
            found += self._hold(pause, use)
        if self._asked:
            return found
        if t_s - self._said_s >= SAY_AGAIN_S:
            self._said_s = t_s
            found.append(Caution(t_s, "not_turned", "this orientation has not been held yet", self.prompt.text))
        if t_s - self._begun_s < PATIENCE_S:
            return found
        if self._number:
            self._asked = True
            return [*found, Ask(Wish.CHECK, CHECK_WAIT_S)]
        not_shown = reason("verification_failed", "not_shown")
        self.checked = Checked((), None, not_shown)
        return [*found, Finished(not_shown.what)]

    def tried(self, tried: Tried) -> list[Output | Finished]:
        """The first calibration; a refused one is not worth verifying."""
        if tried.verdict != REFUSED or tried.reason is None:
            return []
        self.checked = Checked((), False, tried.reason)
        return self._refused(Finished(f"not verified: {tried.reason.message}"), tried.reason)

    def check(self, checked: Checked) -> list[Output | Finished]:
        """What the orientations say."""
        if checked.agrees is None and self._number >= self._aim.verify and self._more:
            # one that was held as new turned out to be known: another one takes its place
            self._more, self._asked, self._begun_s = self._more - 1, False, None
            self._number = self._aim.verify - 1
            self.prompt = self._next(self.prompt)
            return [self.prompt]
        self.checked = checked
        if checked.reason is None:
            return [*checked.found, Finished("verified: the new orientations agree with the predicted uncertainty")]
        return [*checked.found, *self._refused(Finished(checked.reason.what), checked.reason)]

    def enough(self) -> Finished:
        """The person does not want to go on."""
        return self._refusal or Finished("you chose to go on: not verified")

    def resumed(self) -> list[Output]:
        """The board may be anywhere now."""
        self._begun_s = None
        self._pauses.forget()
        return [self.prompt]

    def _refused(self, refusal: Finished, against: Reason) -> list[Output | Finished]:
        """The end, unless the person may want to turn the board again."""
        if not self._attended or not KINDS[against.code].turn_again:
            return [refusal]
        self._refusal, self._begun_s = refusal, None
        self.prompt = Prompt(
            PromptKind.AGAIN, "Turn the board again from the start (r), or end with the refusal (Enter)?"
        )
        return [self.prompt, Caution(self._now_s, "refused", against.what, against.remedy)]

    def _hold(self, pause: Pause, use: Use) -> list[Output | Finished]:
        if self._asked or pause.seconds < HOLD_S - 1e-6:
            return []
        self._pauses.leave(pause.run)
        self._said_s = pause.t_s
        if use is Use.SEEN:
            asked_for = use_of(pause.acc, self.prompt.down, new=True, near_rad=ASKED_FOR_RAD) is Use.TAKEN
            return [held(pause, use), *self._seen_already(pause.t_s, asked_for)]
        self._coverage.pauses(pause.acc)
        self._coverage.rests(pause.acc)
        self._number += 1
        self._begun_s = pause.t_s
        useful = "" if use is Use.TAKEN else ": not the one asked for, but useful"
        text = f"held {self._number} of {self._aim.verify}{useful}"
        progress = Progress(pause.t_s, self._number, self._aim.verify, text)
        if self._number == self._aim.verify:
            self._asked = True
            return [held(pause, use), progress, Ask(Wish.CHECK, CHECK_WAIT_S)]
        self.prompt = self._next(self.prompt)
        return [held(pause, use), progress, self.prompt]

    def _use(self, pause: Pause) -> Use:
        """Of what use it is: what the calibration has seen is of none, even where it was asked for."""
        if self._coverage.was_near(pause.acc, BENT * unseen_rad(self._tilt_only)):
            return Use.SEEN
        return use_of(pause.acc, self.prompt.down, new=True)

    def _seen_already(self, t_s: float, asked_for: bool) -> list[Output | Finished]:
        """Who was where the board was asked to be is asked for another orientation."""
        if asked_for:
            self.prompt = self._next(self.prompt)
        caution = Caution(t_s, "seen_already", "the calibration has seen this orientation already", self.prompt.text)
        return [caution, self.prompt] if asked_for else [caution]

    def _next(self, last: Prompt | None = None) -> Prompt:
        """What is least like all that was shown, and not what was asked for `last`."""
        asked = self._directions
        if last is not None:
            asked = asked[asked @ np.array(last.down) < math.cos(DISTINCT_RAD)]
        down = self._coverage.farthest_from_rests(asked)
        x, y, z = np.asarray(down).tolist()
        side = tilt_down(down) if self._tilt_only else f"{side_down(down)} down"
        number = f"{self._number + 1} of {self._aim.verify}"
        return Prompt(PromptKind.VERIFY, f"Verification {number}: {side}, then hold it still.", (x, y, z))
