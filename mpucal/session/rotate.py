"""The second step of a session: ask for orientations until the target uncertainty is reached."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..data import Samples, Vector
from ..rests.stillness import Sighting
from ..rests.windows import Windows
from . import events
from .aims import SIDES, Aim, Coverage
from .plan import Plan
from .step import ENOUGH, HAND_WINDOW_S, HOLD_S, MEANT_RAD, PATIENCE_S, WAIT_S, Pause, PoseStep

PASS_WINDOW_S = 0.1
# Least length of a pause, and of a rest that a fit uses. A vehicle on the requested side stays on it until the next
# side is named, so a rest is enough there.
PAUSE_S, REST_S = 1.0, 0.5
# At most nine tilts can be asked for; a careless hand reaches at least this number of different ones.
TILTS = 6
# Beyond these the hand's own acceleration hides the direction of gravity [m/s^2].
LEAST_MPS2, MOST_MPS2 = 5.0, 15.0

# Least interval of the fits and of the progress.
KNOW_EVERY_S = REPORT_EVERY_S = 1.0
# Interval of the fits while no new orientation is seen, since they change the estimate little.
SHOW_EVERY_S = 5.0
# The time that is left is estimated from the pace of at least this number of orientations. When fewer than this number
# are left, the estimate also needs the information so far: at least the share LEAST_KNOWN of what the target needs.
FEW, LEAST_KNOWN = 3, 0.25
# An orientation that takes longer than this number of times the pace shows that the pace has changed.
LATE = 2.5


class Rotate(PoseStep):
    """Step that asks for one orientation after another until the target is reached.

    Parameters
    ----------
    flat : the flat rest, the first orientation. aim : the conditions for its end.
    plan : with until_end, nothing is asked for. coverage : empty; the orientations of the turning are added to it.
    """

    def __init__(self, flat: events.Rested, aim: Aim, plan: Plan, coverage: Coverage) -> None:
        super().__init__(flat, plan)
        self._takes_sides = aim.by_sides and not (plan.tilt_only or plan.until_end)
        self._aim, self._coverage = aim, coverage
        self._passes = Windows(PASS_WINDOW_S, spread=False)
        acc = np.array(flat.acc)
        self._coverage.paused.add(acc)
        self._coverage.passed.add(acc)
        self._coverage.rested.add(acc)
        self._knowledge: events.Knowledge | None = None
        # A fit was requested and has not answered yet.
        self._requested = False
        # Number of the last pause that was answered with advice, so that it is answered once.
        self._advised_run = -1
        # Number of orientations at the last fit.
        self._known_number = 0
        self._held: tuple[Pause, events.Use] | None = None
        self._t_s = self._new_s = self._known_s = self._reported_s = 0.0
        # A vehicle that lies flat is on the first side already.
        first = SIDES[1] if self._takes_sides and coverage.paused.near(-SIDES[0]) else self._farthest(coverage.paused)
        self.prompt = self._prompt_for(first)

    def add(self, samples: Samples, sightings: Sequence[Sighting]) -> events.Outputs:
        """See Step; Turned comes last and ends the step."""
        if self._begun_s is None:
            self._begun_s = self._new_s = self._known_s = self._reported_s = self._prompted_s = float(samples.t[0])
        for window in self._passes.add(samples):
            steady = window.whole and LEAST_MPS2 < np.linalg.norm(window.acc) < MOST_MPS2
            if steady and self._coverage.passed.add(window.acc):
                self._new_s = window.end_s
        outputs: events.Outputs = []
        for pause in self._pauses.add(sightings):
            outputs += self._hold(pause)
        self._t_s = t_s = float(samples.t[-1])
        outputs += self._periodic(t_s)
        turned = None if self._plan.until_end else self._time_out(t_s)
        return [*outputs, turned] if turned else outputs

    def answer(self, event: events.Answer) -> events.Outputs:
        """Return the outputs for new uncertainties; Turned comes last and ends the step."""
        return self._learn(event.knowledge, event.advice) if isinstance(event, events.Learnt) else []

    def enough(self) -> events.Outputs:
        """See Step; the turning alone is verified, unless the source is recorded until its end."""
        return super().enough() if self._plan.until_end else [events.Turned(ENOUGH)]

    def _learn(self, knowledge: events.Knowledge, advice: bool) -> events.Outputs:
        """Take new uncertainties: end the step if they reach the target, or ask for the orientation that helps most."""
        self._knowledge, self._requested, self._known_number = knowledge, False, self._coverage.number
        outputs: events.Outputs = [knowledge]
        if self._plan.until_end:
            return outputs
        if advice and self._held is not None:
            # The output goes out now, so it has the time of the last samples and not that of the pause.
            outputs.append(self._held[0].held(self._held[1])._replace(t_s=self._t_s))
        if self._is_enough():
            # Tilts leave some parameters at their prior: the target does not apply to them.
            what = "enough tilts seen" if self._plan.tilt_only else "target reached"
            return [*outputs, events.Turned(f"{what}: {knowledge.words}")]
        if advice and knowledge.down is not None:
            self._prompted_s = knowledge.t_s
            # The advice is not followed in three cases. Tilts all help alike, so each is asked for in turn. The same
            # orientation is not asked for twice in a row, as happens where a sensor with mirrored axes makes the
            # estimate take up for down. Once the target is reached, or a vehicle was on all sides, only a new
            # orientation counts.
            down = np.array(knowledge.down)
            if self._plan.tilt_only or knowledge.down == self.prompt.down or self._adds_nothing(down):
                down = self._farthest(self._coverage.paused)
            self.prompt = self._prompt_for(down)
            outputs.append(self.prompt)
        return outputs

    def _next_side(self) -> Vector | None:
        """Return the next side to turn a vehicle onto; None if no other is left."""
        if not self._takes_sides:
            return None
        left = (side for side in SIDES if not self._coverage.paused.near(-side))
        return next((side for side in left if events.triple(side) != self.prompt.down), None)

    @property
    def _least(self) -> int:
        return TILTS if self._plan.tilt_only else self._aim.least

    @property
    def wanted(self) -> events.Direction | None:
        """Unit vector that is to point down; without a requested orientation, the most useful one."""
        if self.prompt.down is not None or self._knowledge is None:
            return self.prompt.down
        return self._knowledge.down

    def resumed(self) -> Sequence[events.Output]:
        """See Step."""
        self._requested = False
        prompt = super().resumed()
        return [] if self._plan.until_end else prompt

    def _hold(self, pause: Pause) -> events.Outputs:
        """Return the outputs for a pause so far: countdown, new orientation, and what is asked for when it is over.

        Where a side is asked for, the next one follows at once. Else the advice of a fit is requested.
        """
        # The advice ends the countdown of its pause, also where a bump had delayed it.
        advised = pause.run <= self._advised_run
        # A pause that the coverage has counted is not new any more: its use was decided before.
        if self._held is None or self._held[0].run != pause.run or (pause.seconds < PAUSE_S - 1e-6 and not advised):
            self._held = pause, pause.use(self.prompt.down, not self._coverage.paused.near(pause.acc))
        outputs: events.Outputs = [*pause.counting(self._held[1])] if self._requested or not advised else []
        if pause.seconds >= REST_S - 1e-6:
            self._coverage.rested.add(pause.acc)
        on_side = self._takes_sides and pause.is_near(self.prompt.down, MEANT_RAD)
        least_s = REST_S if on_side else HOLD_S - WAIT_S
        is_over = not (self._plan.until_end or advised) and pause.seconds >= least_s - 1e-6
        is_counted = pause.seconds >= PAUSE_S - 1e-6 or (is_over and on_side)
        if is_counted and self._coverage.paused.add(pause.acc):
            self._new_s = pause.t_s
            outputs.append(events.Seen(pause.t_s, len(self._coverage.paused), events.down_of(pause.acc), paused=True))
        if is_over and (side := self._next_side()) is not None:
            # The next side of a vehicle is known without a fit.
            self._advised_run, self._prompted_s, self.prompt = pause.run, pause.t_s, self._prompt_for(side)
            outputs += [pause.held(self._held[1]), self.prompt]
        elif is_over and not self._requested:
            self._advised_run = pause.run
            outputs.append(self._request(events.FitKind.ADVISE, pause.t_s, HAND_WINDOW_S if on_side else WAIT_S))
        return outputs

    def _request(self, kind: events.FitKind, t_s: float, wait_s: float = WAIT_S) -> events.RequestFit:
        """Return the request of a fit, and note that and when it was made."""
        self._requested, self._known_s = True, t_s
        return events.RequestFit(kind, wait_s)

    def _periodic(self, t_s: float) -> list[events.Output]:
        """Return the request of the next fit, the progress and the reminder, each if its time has come."""
        outputs: list[events.Output] = []
        new = self._coverage.number > self._known_number and not self._plan.until_end
        if not self._requested and t_s - self._known_s >= (KNOW_EVERY_S if new else SHOW_EVERY_S):
            outputs.append(self._request(events.FitKind.KNOW, t_s))
        if t_s - self._reported_s >= REPORT_EVERY_S:
            self._reported_s = t_s
            done = min(self._coverage.number, self._least)
            outputs.append(events.Progress(t_s, done, self._least, self._count_text(), self._estimate_left_s(t_s)))
        if not self._plan.until_end:
            outputs += self._remind(t_s, self._new_s, "no new orientation for a while")
        return outputs

    def _count_text(self) -> str:
        """Return the number of orientations as text; with the reason where more are asked for than the target needs."""
        number, least = self._coverage.number, self._least
        text = f"orientation {number} of {least}" if number <= least else f"{number} orientations, of at least {least}"
        if not self._has_target() or self._plan.tilt_only or self._plan.until_end:
            return text
        if number < least:
            return f"{text} (bars full; more sides confirm them)"
        return text if self._coverage.varied else f"{text} (bars full, but too similar)"

    def _estimate_left_s(self, t_s: float) -> float | None:
        """Return the time until the end of the verification, at the pace of the orientations so far; None: unknown.

        The least number of orientations is most often enough. When few are left, the estimate uses the information too:
        it is the inverse of the variance, and each orientation adds about as much to it as those before.
        """
        taken, left = self._coverage.number - 1, max(self._least - self._coverage.number, 0)
        if taken < FEW or self._plan.until_end or self._begun_s is None:
            return None
        if not self._plan.tilt_only and left < FEW:
            known = self._knowledge.overall**2 if self._knowledge else 0.0
            if known < LEAST_KNOWN or not self._coverage.varied:
                return None
            left = max(left, math.ceil(taken * (1.0 - known) / known))
        # The orientation that is being turned to has begun when the last new one was found.
        pace_s, since_s = (self._new_s - self._begun_s) / taken, t_s - self._new_s
        if since_s > LATE * pace_s:
            return None
        return max((left + self._aim.verify) * pace_s - since_s, self._aim.verify * pace_s)

    def _has_target(self) -> bool:
        return self._knowledge is not None and self._knowledge.overall >= 1.0

    def _adds_nothing(self, down: Vector) -> bool:
        """Return True for an orientation that was seen, where the target is reached or a vehicle was on all sides."""
        return (self._has_target() or self._was_on_all_sides) and self._coverage.paused.near(-down)

    def _is_enough(self) -> bool:
        if self._coverage.number < self._least or self._plan.tilt_only:
            return self._coverage.number >= self._least
        # All sides are enough, though not varied: the gyroscope determines the angles between the axes.
        return (self._coverage.varied or self._was_on_all_sides) and self._has_target()

    @property
    def _was_on_all_sides(self) -> bool:
        return self._takes_sides and all(self._coverage.paused.near(-side) for side in SIDES)

    def _time_out(self, t_s: float) -> events.Turned | None:
        """Return the end of the step if its time is over; None if not."""
        known = f": {self._knowledge.words}" if self._knowledge else ""
        if t_s - self._new_s >= PATIENCE_S:
            return events.Turned(f"no new orientation for {PATIENCE_S:.0f} s, {self._coverage.number} seen{known}")
        if self._begun_s is not None and t_s - self._begun_s >= self._aim.longest_s:
            return events.Turned(f"time limit of {self._aim.longest_s:.0f} s for turning reached{known}")
        return None

    def _prompt_for(self, down: Vector) -> events.Prompt:
        if self._plan.until_end:
            text = "Turn the board through many different orientations, tilted ones too, and hold each for 2 s."
            return events.Prompt(events.PromptKind.ROTATE, text)
        return self._ask_for(events.PromptKind.ROTATE, down, "Turn the board: {}, then hold it still.")
