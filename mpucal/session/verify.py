"""The last step: orientations that check a calibration, the session's first one or (`mpucal check`) an older one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Samples
from ..reasons import KINDS, Reason, reason
from ..rests.stillness import Sighting
from ..result.calibration import GOOD, REFUSED
from . import events
from .aims import AIMS, NORMAL, QUICK, SAME_RAD, Aim, Coverage, Directions, unseen_rad
from .plan import Plan
from .step import ENOUGH, HOLD_S, MEANT_RAD, PATIENCE_S, USE_TEXTS, VERIFY_PATIENCE_S, WAIT_S, Pause, PoseStep


class NewPoses(PoseStep):
    """Base of the steps that ask for `of` orientations that were not seen, and take any new one.

    Parameters
    ----------
    flat : the flat rest. plan : settings of the session. of : number of orientations.
    seen : the orientations so far, to which the new ones are added. apart_rad : least angle of a new one from each.
    hold_s : time for which each is to be held.
    """

    def __init__(
        self, flat: events.Rested, plan: Plan, of: int, seen: Directions, apart_rad: float, hold_s: float = HOLD_S
    ) -> None:
        super().__init__(flat, plan, hold_s)
        self._of, self._seen, self._apart_rad, self._hold_s = of, seen, apart_rad, hold_s
        self._number = 0
        # True if no further orientation is taken: there are enough, or the time for them is over.
        self._closed = False
        self.prompt = self._next()

    def _take(self, sightings: Sequence[Sighting]) -> list[events.Output]:
        """Return the outputs for the pauses in `sightings`."""
        outputs: list[events.Output] = []
        for pause in self._pauses.add(sightings):
            if self._closed:
                break
            new = not self._seen.near(pause.acc, self._apart_rad)
            # An orientation that was seen is of no use, even if it is the wanted one.
            use = pause.use(self.prompt.down, new) if new else events.Use.SEEN
            outputs += pause.counting(use)
            if pause.seconds >= self._hold_s - 1e-6:
                self._pauses.leave(pause.run)
                self._prompted_s = pause.t_s
                outputs += [pause.held(use), *(self._count(pause, use) if new else self._seen_already(pause))]
        return outputs

    def _count(self, pause: Pause, use: events.Use) -> list[events.Output]:
        """Count a new orientation; return the progress, and the next prompt where more are asked for."""
        self._seen.add(pause.acc)
        self._number += 1
        left_s = (self._of - self._number) * (pause.t_s - (self._begun_s or pause.t_s))
        self._begun_s = pause.t_s
        text = f"held {self._number} of {self._of}" + ("" if use is events.Use.TAKEN else f": {USE_TEXTS[use]}")
        self._closed = self._number == self._of
        outputs: list[events.Output] = [events.Progress(pause.t_s, self._number, self._of, text, left_s or None)]
        if not self._closed:
            self.prompt = self._next()
            outputs.append(self.prompt)
        return outputs

    def _seen_already(self, pause: Pause) -> list[events.Output]:
        """Return a caution; if the requested orientation was already seen, request a different one."""
        meant = pause.is_near(self.prompt.down, MEANT_RAD)
        if meant:
            self.prompt = self._next()
        caution = events.Caution(pause.t_s, "seen_already", "this orientation was seen already", self.prompt.text)
        return [caution, self.prompt] if meant else [caution]

    def _next(self) -> events.Prompt:
        """Return a prompt for the next orientation."""
        raise NotImplementedError


# Bias and scale factor errors change angles between raw directions by up to a tenth. So raw directions must be farther
# apart, by this factor, than the calibrated ones of new orientations.
BENT = 1.1
# Session time after which the first calibration is taken; the person turns the board meanwhile.
TRY_WAIT_S = 2.5
# Number of orientations that may be requested in place of ones that the calibration has seen after all.
MOST_REPLACEMENTS = 2


class Verify(NewPoses):
    """Step that asks for `aim.verify` new orientations, and compares the first calibration with them.

    Parameters
    ----------
    flat : the flat rest. coverage : the orientations of the turning.
    plan : a person who can press keys is offered to turn the board again where that may help.
    """

    def __init__(self, flat: events.Rested, aim: Aim, plan: Plan, coverage: Coverage) -> None:
        super().__init__(flat, plan, aim.verify, coverage.rested, BENT * unseen_rad(plan.tilt_only))
        self._refusal: events.Finished | None = None
        self._try_requested = False
        self._replacements_left = MOST_REPLACEMENTS
        # Result of the comparison after which the first calibration was computed again, and how many of the new
        # orientations that calibration has used.
        self._doubt: events.Checked | None = None
        self._used = 0
        self._now_s = 0.0

    def begin(self) -> list[events.Output]:
        """See Step."""
        return [self.prompt]

    def add(self, samples: Samples, sightings: Sequence[Sighting]) -> events.Outputs:
        """See Step; Finished comes last and ends the step."""
        t_s = self._now_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._prompted_s = t_s
        if self._refusal is not None:
            return [self._refusal] if t_s - self._begun_s >= PATIENCE_S else []
        check_requested = self._closed
        outputs: events.Outputs = [*self._take(sightings)]
        if not self._try_requested and t_s - self._begun_s >= WAIT_S:
            # A person needs a moment to move: the first calibration uses as much as possible of the last rest.
            self._try_requested = True
            outputs.append(events.RequestFit(events.FitKind.TRY, TRY_WAIT_S))
        if check_requested:
            return outputs
        if not self._closed:
            outputs += self._remind(t_s, self._prompted_s, "this orientation has not been held yet")
            if t_s - self._begun_s < VERIFY_PATIENCE_S:
                return outputs
            # The time is over: what was held by now must do, if there is a new orientation.
            self._closed = self._number > self._used
        if self._closed:
            return [*outputs, events.RequestFit(events.FitKind.CHECK, WAIT_S, self._of - self._used)]
        if self._doubt is not None:
            return [*outputs, *self._end(self._doubt)]
        not_shown = reason("verification_failed", "not_shown")
        self.checked = events.Checked((), None, not_shown)
        return [*outputs, events.Finished(not_shown.what)]

    def answer(self, event: events.Answer) -> events.Outputs:
        """Take the first calibration, or its comparison with new orientations; ignore late answers to the rotation."""
        match event:
            case events.Tried():
                return self._tried(event)
            case events.Checked():
                return self._check(event)
        return []

    def enough(self) -> events.Outputs:
        """See Step."""
        return [self._refusal or events.Finished(f"{ENOUGH}: not verified")]

    def _tried(self, tried: events.Tried) -> events.Outputs:
        """Take the first calibration; one that is not good needs more orientations, and a refused one needs none."""
        if tried.verdict != GOOD and not self._closed:
            self._of = max(self._of, AIMS[QUICK].verify)
        if tried.verdict != REFUSED or tried.reason is None:
            return []
        self.checked = events.Checked((), False, tried.reason)
        return self._refused(events.Finished(f"not verified: {tried.reason.message}"), tried.reason)

    def _check(self, checked: events.Checked) -> events.Outputs:
        """Take the comparison with the new orientations."""
        if checked.doubtful and self._doubt is None:
            return self._try_again(checked)
        if checked.agrees is None and self._number >= self._of and self._replacements_left and self._doubt is None:
            # The fit has seen one of these orientations after all, or finds too short a rest: another one replaces it.
            self._replacements_left, self._closed, self._begun_s = self._replacements_left - 1, False, None
            self._number = self._of - 1
            self.prompt = self._next()
            return [self.prompt]
        return [*(self._counted(each) for each in checked.verifications), *self._end(checked)]

    def _counted(self, verification: events.Verification) -> events.Verification:
        """Return a verification with its number among all new orientations, with those that the calibration has used.

        The first calibration uses some if it was computed again.
        """
        if not self._used:
            return verification
        number, of = verification.number + self._used, verification.of + self._used
        text = verification.text.replace(f"{verification.number} of {verification.of}", f"{number} of {of}", 1)
        return verification._replace(number=number, of=of, text=text)

    def _end(self, checked: events.Checked) -> events.Outputs:
        """Set the result of the verification, and return the outputs that end the step or offer to turn again."""
        self.checked = checked
        if checked.reason is None:
            return [events.Finished("verified: the new orientations agree with the predicted uncertainty")]
        return self._refused(events.Finished(checked.reason.what), checked.reason)

    def _try_again(self, checked: events.Checked) -> events.Outputs:
        """Compute the first calibration again, with the orientations so far, and request one more to verify it."""
        self._doubt, self._closed, self._begun_s, self._try_requested = checked, False, None, False
        self._used, self._of = self._number, self._number + 1
        self.prompt = self._next()
        doubt = checked.reason.what if checked.reason else ""
        caution = events.Caution(self._now_s, "doubtful", doubt, "one more orientation decides if that matters")
        return [*checked.verifications, caution, self.prompt]

    def _refused(self, refusal: events.Finished, against: Reason) -> events.Outputs:
        """Return the refusal, or offer to turn the board again, where that may help and somebody can answer."""
        if not self._plan.attended or not KINDS[against.code].turn_again:
            return [refusal]
        self._refusal, self._begun_s = refusal, None
        self.prompt = events.Prompt(
            events.PromptKind.AGAIN, "Turn the board again from the start (r), or end with the refusal (Enter)?"
        )
        return [self.prompt, events.Caution(self._now_s, "refused", against.what, against.remedy)]

    def _next(self) -> events.Prompt:
        """See NewPoses; it asks for the direction that is farthest from all rests."""
        text = f"Verification {self._number + 1} of {self._of}: {{}}, then hold it still."
        return self._ask_for(events.PromptKind.VERIFY, self._farthest(self._seen), text)


# A check has few samples: a longer hold averages the hand's tremor.
CHECK_HOLD_S = 2.0
# Weight that prefers, of both directions along an axis, the one that is farther from all others.
OTHER_WAY = 0.1


class CheckPoses(NewPoses):
    """Step that asks for the orientations that would show most, and takes any new one."""

    def __init__(self, flat: events.Rested, plan: Plan) -> None:
        seen = Directions(SAME_RAD)
        seen.add(np.array(flat.acc))
        super().__init__(flat, plan, AIMS[NORMAL].verify, seen, unseen_rad(plan.tilt_only), CHECK_HOLD_S)

    def add(self, samples: Samples, sightings: Sequence[Sighting]) -> events.Outputs:
        """See Step; Finished comes last and ends the step."""
        t_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._prompted_s = t_s
        outputs = self._take(sightings)
        if self._closed:
            return [*outputs, events.Finished(f"{self._of} orientations: done")]
        if t_s - self._begun_s >= VERIFY_PATIENCE_S:
            return [*outputs, events.Finished(f"no new orientation for {VERIFY_PATIENCE_S:.0f} s")]
        return [*outputs, *self._remind(t_s, self._prompted_s, "no new orientation for a while")]

    def _next(self) -> events.Prompt:
        """See NewPoses; it asks for the axis farthest from those of all orientations: each direction shows a bias."""
        along = -self._directions @ self._seen.units.T
        down = self._directions[int((np.abs(along).max(1) + OTHER_WAY * along.max(1)).argmin())]
        text = f"Orientation {self._number + 1} of {self._of}: {{}}, or any other new one, then hold it still for 2 s."
        return self._ask_for(events.PromptKind.VERIFY, down, text)
