"""The last step: orientations that check a calibration, the session's first one or (`mpucal check`) an older one."""

from __future__ import annotations

import math

import numpy as np

from ..data import Samples
from ..reasons import KINDS, Reason, reason
from ..result.calibration import REFUSED
from .aims import ALL_AROUND, VERIFY_PLACED, Aim, directions, unseen_rad
from .boards import BOARD, describe, describe_tilt
from .coverage import DISTINCT_RAD, Coverage, Directions
from .events import (
    Caution,
    Checked,
    Finished,
    FitKind,
    Learnt,
    Output,
    Progress,
    Prompt,
    PromptKind,
    RequestFit,
    Rested,
    Tried,
    Use,
    down_of,
    triple,
)
from .plan import Plan
from .step import (
    ENOUGH,
    HOLD_S,
    PATIENCE_S,
    VERIFY_PATIENCE_S,
    WAIT_S,
    Pause,
    PoseStep,
    classify_use,
    countdown,
    held,
    is_wanted,
)

# Bias and scale factor errors bend raw directions by up to a tenth: these must be farther apart by that.
BENT = 1.1
# A hand that is this near to the requested orientation meant to be there.
ASKED_FOR_RAD = math.radians(25.0)
# Session time after which the first calibration is taken; the person turns the board meanwhile.
TRY_WAIT_S = 3.0
# Number of orientations that may be requested in place of ones that the calibration has seen after all.
MOST_MORE = 2


class Verify(PoseStep):
    """Step that asks for `aim.verify` new orientations, or VERIFY_PLACED, and compares the first calibration with them.

    Parameters
    ----------
    flat : the flat rest. coverage : the orientations of the turning.
    plan : a person who can press keys is offered to turn the board again where that may help.
    """

    def __init__(self, flat: Rested, aim: Aim, plan: Plan, coverage: Coverage) -> None:
        super().__init__(flat)
        self._plan, self._coverage = plan, coverage
        self._of = VERIFY_PLACED if coverage.placed else aim.verify
        self._directions = directions(down_of(np.array(flat.acc)), plan.tilt_only)
        self._refusal: Finished | None = None
        self._requested, self._more = False, MOST_MORE
        self._now_s = 0.0
        self.prompt = self._next()

    def begin(self) -> list[Output]:
        """See Step."""
        return [RequestFit(FitKind.TRY, TRY_WAIT_S), self.prompt]

    def add(self, samples: Samples) -> list[Output | Finished]:
        """Return the outputs for `samples`; Finished comes last and ends the step."""
        t_s = self._now_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._prompted_s = t_s
        if self._refusal is not None:
            return [self._refusal] if t_s - self._begun_s >= PATIENCE_S else []
        outputs: list[Output | Finished] = []
        for pause in self._pauses.add(samples):
            use = self._classify_use(pause)
            outputs += [] if self._requested else countdown(pause, use)
            outputs += self._hold(pause, use)
        if self._requested:
            return outputs
        outputs += self._remind(t_s, self._prompted_s, "this orientation has not been held yet")
        if t_s - self._begun_s < VERIFY_PATIENCE_S:
            return outputs
        if self._number:
            self._requested = True
            return [*outputs, RequestFit(FitKind.CHECK, WAIT_S, self._of)]
        not_shown = reason("verification_failed", "not_shown")
        self.checked = Checked((), None, not_shown)
        return [*outputs, Finished(not_shown.what)]

    def answer(self, event: Learnt | Tried | Checked) -> list[Output | Finished]:
        """Take the first calibration, or its comparison with the new orientations; the rotation's come too late."""
        match event:
            case Tried():
                return self._tried(event)
            case Checked():
                return self._check(event)
        return []

    def enough(self) -> list[Finished]:
        """See Step."""
        return [self._refusal or Finished(f"{ENOUGH}: not verified")]

    def _tried(self, tried: Tried) -> list[Output | Finished]:
        """Take the first calibration; one that is refused needs no verification."""
        if tried.verdict != REFUSED or tried.reason is None:
            return []
        self.checked = Checked((), False, tried.reason)
        return self._refused(Finished(f"not verified: {tried.reason.message}"), tried.reason)

    def _check(self, checked: Checked) -> list[Output | Finished]:
        """Take the comparison with the new orientations."""
        if checked.agrees is None and self._number >= self._of and self._more:
            # The fit has seen one of these orientations after all: another one replaces it.
            self._more, self._requested, self._begun_s = self._more - 1, False, None
            self._number = self._of - 1
            self.prompt = self._next(self.prompt)
            return [self.prompt]
        self.checked = checked
        if checked.reason is None:
            agreement = Finished("verified: the new orientations agree with the predicted uncertainty")
            return [*checked.verifications, agreement]
        return [*checked.verifications, *self._refused(Finished(checked.reason.what), checked.reason)]

    def _refused(self, refusal: Finished, against: Reason) -> list[Output | Finished]:
        """Return the refusal, or offer to turn the board again, where that may help and somebody can answer."""
        if not self._plan.attended or not KINDS[against.code].turn_again:
            return [refusal]
        self._refusal, self._begun_s = refusal, None
        self.prompt = Prompt(
            PromptKind.AGAIN, "Turn the board again from the start (r), or end with the refusal (Enter)?"
        )
        return [self.prompt, Caution(self._now_s, "refused", against.what, against.remedy)]

    def _hold(self, pause: Pause, use: Use) -> list[Output | Finished]:
        if self._requested or pause.seconds < HOLD_S - 1e-6:
            return []
        self._pauses.leave(pause.run)
        self._prompted_s = pause.t_s
        if use is Use.SEEN:
            return [held(pause, use), *self._seen_already(pause)]
        self._coverage.paused.add(pause.acc)
        self._coverage.rested.add(pause.acc)
        self._number += 1
        left_s = (self._of - self._number) * (pause.t_s - (self._begun_s or pause.t_s))
        self._begun_s = pause.t_s
        useful = "" if use is Use.TAKEN else ": not the one asked for, but useful"
        text = f"held {self._number} of {self._of}{useful}"
        progress = Progress(pause.t_s, self._number, self._of, text, left_s or None)
        if self._number == self._of:
            self._requested = True
            return [held(pause, use), progress, RequestFit(FitKind.CHECK, WAIT_S, self._of)]
        self.prompt = self._next(self.prompt)
        return [held(pause, use), progress, self.prompt]

    def _classify_use(self, pause: Pause) -> Use:
        """Return SEEN if the fit already used this orientation, even when it was requested."""
        if self._coverage.rested.near(pause.acc, BENT * unseen_rad(self._plan.tilt_only)):
            return Use.SEEN
        return classify_use(pause.acc, self.prompt.down, new=True)

    def _seen_already(self, pause: Pause) -> list[Output | Finished]:
        """Return a caution; if the requested orientation was already seen, request a different one."""
        asked_for = is_wanted(pause.acc, self.prompt.down, ASKED_FOR_RAD)
        if asked_for:
            self.prompt = self._next(self.prompt)
        what = "the calibration has seen this orientation already"
        caution = Caution(pause.t_s, "seen_already", what, self.prompt.text)
        return [caution, self.prompt] if asked_for else [caution]

    def _next(self, last: Prompt | None = None) -> Prompt:
        """Return a prompt for the direction farthest from all rests, at least DISTINCT_RAD from the `last` one."""
        candidates = self._directions
        if last is not None:
            candidates = candidates[candidates @ np.array(last.down) < math.cos(DISTINCT_RAD)]
        down = self._coverage.rested.farthest_down(candidates)
        words = (describe_tilt if self._plan.tilt_only else describe)(triple(down), self._plan.board)
        number = f"{self._number + 1} of {self._of}"
        return Prompt(PromptKind.VERIFY, f"Verification {number}: {words}, then hold it still.", triple(down))


ORIENTATIONS = 3
# A check has few samples: a longer hold averages the hand's tremor.
CHECK_HOLD_S = 2.0
# Weight that prefers, of both directions along an axis, the one that is farther from all others.
OTHER_WAY = 0.1


class CheckPoses(PoseStep):
    """Step that asks for the orientations that would show most, and takes any new one."""

    def __init__(self, flat: Rested, board: str = BOARD) -> None:
        super().__init__(flat, CHECK_HOLD_S)
        self._board = board
        self._shown = Directions()
        self._shown.add(np.array(flat.acc))
        self.prompt = self._next()

    def add(self, samples: Samples) -> list[Output | Finished]:
        """Return the outputs for `samples`; Finished comes last and ends the step."""
        t_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._prompted_s = t_s
        outputs: list[Output | Finished] = []
        for pause in self._pauses.add(samples):
            if self._number < ORIENTATIONS:
                outputs += self._hold(pause)
        if self._number == ORIENTATIONS:
            return [*outputs, Finished(f"{ORIENTATIONS} orientations: done")]
        if t_s - self._begun_s >= VERIFY_PATIENCE_S:
            return [*outputs, Finished(f"no new orientation for {VERIFY_PATIENCE_S:.0f} s")]
        return [*outputs, *self._remind(t_s, self._prompted_s, "no new orientation for a while")]

    def _hold(self, pause: Pause) -> list[Output]:
        new = not self._shown.near(pause.acc)
        use = classify_use(pause.acc, self.prompt.down, new) if new else Use.SEEN
        outputs: list[Output] = [*countdown(pause, use)]
        if pause.seconds < CHECK_HOLD_S - 1e-6:
            return outputs
        self._pauses.leave(pause.run)
        self._prompted_s = pause.t_s
        outputs.append(held(pause, use))
        if not new:
            seen = Caution(pause.t_s, "seen_already", "this orientation was shown already", self.prompt.text)
            return [*outputs, seen]
        self._shown.add(pause.acc)
        self._number += 1
        self._begun_s = pause.t_s
        outputs.append(Progress(pause.t_s, self._number, ORIENTATIONS, f"held {self._number} of {ORIENTATIONS}"))
        if self._number < ORIENTATIONS:
            self.prompt = self._next()
            outputs.append(self.prompt)
        return outputs

    def _next(self) -> Prompt:
        """Return a prompt for the axis that differs most from all orientations shown: a bias shows along either way."""
        along = -ALL_AROUND @ self._shown.units.T
        down = ALL_AROUND[int((np.abs(along).max(1) + OTHER_WAY * along.max(1)).argmin())]
        number = f"{self._number + 1} of {ORIENTATIONS}"
        words = describe(triple(down), self._board)
        text = f"Orientation {number}: {words}, or any other new one, then hold it still for 2 s."
        return Prompt(PromptKind.VERIFY, text, triple(down))
