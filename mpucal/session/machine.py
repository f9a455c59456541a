"""The state machine of a guided session: events in; prompts, progress, decisions and requests for fits out.

Time comes with the events, so a replayed session gives the same outputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..data import Samples, Sensor
from . import events
from .aims import Coverage, select_aim
from .boards import speak_of, usual_board
from .lay_flat import LayFlat
from .meter import MotionWatch
from .plan import Plan
from .rotate import Rotate
from .step import Step
from .table import MEASURING, State, next_state
from .verify import CheckPoses, Verify

# A source that is polled must answer within this time.
SILENT_S = 5.0
# A longer time between two polls means that the computer was stopped or suspended.
ASKED_S = 2.0

REST = events.Prompt(events.PromptKind.REST, "You can put the board down.")
COMPUTING = events.Prompt(events.PromptKind.REST, "You can put the board down. The calibration is being computed.")
ABORTED = "the session was interrupted"
START_AGAIN = "start again when you are ready"


class Machine:
    """State machine of one session.

    Parameters
    ----------
    plan : settings of the session. checking : an existing calibration is checked, and none is made.

    Attributes
    ----------
    state : present state of the table.
    """

    def __init__(self, plan: Plan | None = None, checking: bool = False) -> None:
        self.state = State.CONNECT
        self._plan, self._checking = plan or Plan(), checking
        self._aim = select_aim(self._plan.target)
        self._step: Step = LayFlat()
        self._coverage = Coverage()
        self._watch = MotionWatch(Sensor())
        self._flat: events.Rested | None = None
        self._samples = self._flat_samples = 0
        self._sampled_s: float | None = None
        self._ticked_s: float | None = None
        self._away_s = 0.0

    @property
    def checked(self) -> events.Checked | None:
        """Result of the verification; None where there was none."""
        return self._step.checked

    def handle(self, event: events.Event) -> list[events.Output]:
        """Process one event; return the outputs.

        Raises
        ------
        IllegalEvent : the event is not legal in this state, which does not change.
        """
        self.state, begins = next_state(self.state, event)
        outputs = [*self._react(event, begins), *(self._begin() if begins else [])]
        return [speak_of(output, self._plan.board) for output in outputs]

    def _react(self, event: events.Event, begins: bool) -> Sequence[events.Output]:
        """Return the outputs for an event; `begins` : it begins the state that it leads to."""
        match event:
            case events.Measured(samples):
                return self._measured(samples) if len(samples) else []
            case events.Tick(t_s):
                return self._tick(t_s)
            case events.Connected(sensor):
                self._aim, self._watch = select_aim(self._plan.target, sensor), MotionWatch(sensor)
                self._plan = replace(self._plan, board=self._plan.board or usual_board(sensor.origin))
            case events.Rested(still_s):
                self._flat, self._flat_samples = event, self._samples
                self._watch.flat()
                return [events.Decision(f"flat and still for {still_s:.0f} s: done")]
            case events.Turned(why) | events.Finished(why):
                return [events.Decision(why)]
            case events.Enough() if self.state in MEASURING:
                return self._dispatch(self._step.enough())
            case events.Redo() if begins:
                # The samples of the turning are dropped, those of the flat rest are kept.
                again = events.Decision("the turning starts again; what was turned so far is discarded")
                return [again, events.Forget(self._flat_samples, self._samples)]
            case events.Resumed():
                self._sampled_s = self._ticked_s = None
                return [
                    events.Decision("the session resumes where it stopped"),
                    *([] if begins else self._resumed()),
                ]
            case events.Learnt() | events.Tried() | events.Checked():
                return self._dispatch(self._step.answer(event))
            case events.Stopped(why, remedy):
                return [events.Decision(why, remedy)]
            case events.Abort():
                return [events.Decision(ABORTED, START_AGAIN)]
            case events.SourceEnded(why):
                return [self._ended(why)]
            case events.Fitted(verdict):
                return [events.Decision(f"the calibration is {verdict}")]
            case events.Written(names):
                return [events.Decision(f"wrote {', '.join(names)}")]
        return []

    def _begin(self) -> Sequence[events.Output]:
        """Begin the step of the present state, if it has one; return the first outputs."""
        if self._flat is not None:
            self._watch.begin(np.array(self._flat.gyr))
        match self.state:
            case State.LAY_FLAT:
                self._step = LayFlat(self._plan.until_end, self._plan.board, self._aim.flat_s)
            case State.ROTATE if self._flat is not None:
                self._coverage = Coverage()
                self._step = (
                    CheckPoses(self._flat, self._plan)
                    if self._checking
                    else Rotate(self._flat, self._aim, self._plan, self._coverage)
                )
            case State.VERIFY if self._flat is not None:
                self._step = Verify(self._flat, self._aim, self._plan, self._coverage)
            case State.CALIBRATE | State.ABORTED:
                return [COMPUTING if self.state is State.CALIBRATE and not self._checking else REST]
            case _:
                return []
        return self._step.begin()

    def _measured(self, samples: Samples) -> list[events.Output]:
        # After a long silence the person starts the present prompt again, and its time limit starts again, too.
        first_s, last_s = float(samples.t[0]), float(samples.t[-1])
        before_s = first_s if self._sampled_s is None else self._sampled_s
        silent = first_s - before_s > SILENT_S or (
            last_s - first_s > SILENT_S and float(np.diff(samples.t).max()) > SILENT_S
        )
        again = self._resumed() if silent else []
        self._sampled_s, self._away_s = last_s, 0.0
        self._samples += len(samples)
        meters = self._watch.add(samples, self._step.wanted)
        return [*again, *meters, *self._dispatch(self._step.add(samples, self._watch.sightings))]

    def _resumed(self) -> Sequence[events.Output]:
        """Start the present prompt again after a gap."""
        self._watch.forget()
        return self._step.resumed()

    def _dispatch(self, items: events.Outputs) -> list[events.Output]:
        """Return the outputs of a step; its events change the state, and add their outputs."""
        outputs: list[events.Output] = []
        for item in items:
            if isinstance(item, events.End):
                outputs += self.handle(item)
            else:
                outputs.append(item)
        return outputs

    def _tick(self, t_s: float) -> list[events.Output]:
        if self._sampled_s is None:
            self._sampled_s = t_s
        if self._ticked_s is not None:
            # While the computer was stopped or suspended, the source was not polled.
            self._away_s += max(t_s - self._ticked_s - ASKED_S, 0.0)
        self._ticked_s = t_s
        if t_s - self._sampled_s - self._away_s < SILENT_S:
            return []
        why = f"the sensor sent no samples for {SILENT_S:.0f} s"
        if self._flat:
            return self.handle(events.Finished(why))
        return self.handle(events.Stopped(why, "check the wiring, then start again"))

    def _ended(self, why: str | None) -> events.Decision:
        if self.state is State.CALIBRATE:
            what = f"the source failed while the board was turned ({why})" if why else "the source ended"
            return events.Decision(f"{what}; {'checking' if self._checking else 'calibrating'} with the data so far")
        if why:
            return events.Decision(why)
        remedy = "record it again: flat and still first, then turned through varied orientations"
        return events.Decision("the source ended before the board was turned", remedy)
