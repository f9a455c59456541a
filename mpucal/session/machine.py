"""The state machine of a guided session: events in; prompts, progress, decisions and requests for fits out.

Time comes with the events, so a replayed session gives the same outputs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .aims import NORMAL, select_aim
from .boards import BOARD, name_board, speak_of, usual_board
from .check_poses import CheckPoses
from .events import (
    Abort,
    Checked,
    Connected,
    Decision,
    Enough,
    Event,
    Finished,
    Fitted,
    Forget,
    Learnt,
    Measured,
    Output,
    Prompt,
    PromptKind,
    Redo,
    Rested,
    Resumed,
    SourceEnded,
    Stopped,
    Tick,
    Tried,
    Turned,
    Written,
)
from .lay_flat import LayFlat
from .meter import MotionWatch
from .rotate import Rotate
from .table import State, next_state
from .verify import Verify

# A source that is polled must answer within this time.
SILENT_S = 5.0
# A longer time between two polls means that the computer was stopped or suspended.
ASKED_S = 2.0

ABORTED = "the session was interrupted"
START_AGAIN = "start again when you are ready"
ENOUGH = "you chose to go on"


class Machine:
    """State machine of one session.

    Parameters
    ----------
    until_end : no step has a time limit, and the turning ends with the source.
    target : one of AIMS. tilt_only : ask for tilts alone, for a board that cannot be turned over.
    attended : somebody can press keys. checking : an existing calibration is checked, and none is made.
    board : its kind, for the words of the prompts; empty: the sensor's.

    Attributes
    ----------
    state : present state of the table.
    """

    def __init__(
        self,
        until_end: bool = False,
        target: str = NORMAL,
        tilt_only: bool = False,
        attended: bool = False,
        checking: bool = False,
        board: str = "",
    ) -> None:
        self.state = State.CONNECT
        self._until_end, self._target, self._tilt_only = until_end, target, tilt_only
        self._aim = select_aim(target)
        self._attended, self._checking, self._board = attended, checking, board
        self._step: LayFlat | Rotate | CheckPoses | Verify = LayFlat()
        self._watch: MotionWatch | None = None
        self._flat: Rested | None = None
        self._samples = self._flat_samples = 0
        self._sampled_s: float | None = None
        self._ticked_s: float | None = None
        self._away_s = 0.0

    @property
    def checked(self) -> Checked | None:
        """Result of the verification; None where there was none."""
        return self._step.checked if isinstance(self._step, Verify) else None

    def handle(self, event: Event) -> list[Output]:
        """Process one event; return the outputs.

        Raises
        ------
        IllegalEvent : the event is not legal in this state, which does not change.
        """
        return [speak_of(output, self._board) for output in self._handle(event)]

    def _handle(self, event: Event) -> list[Output]:
        before, self.state = self.state, next_state(self.state, event)
        match event:
            case Measured(samples):
                return self._measured(event) if len(samples) else []
            case Tick(t_s):
                return self._tick(t_s)
            case Connected(sensor):
                self._aim, self._watch = select_aim(self._target, sensor), MotionWatch(sensor)
                self._board = self._board or usual_board(sensor.origin)
                self._step = LayFlat(self._until_end, self._board)
                return [self._step.prompt]
            case Rested(still_s):
                self._flat, self._flat_samples = event, self._samples
                if self._watch is not None:
                    self._watch.flat()
                return [Decision(f"flat and still for {still_s:.0f} s: done"), *self._turn(event)]
            case Turned(why):
                return [Decision(why), *self._verify()]
            case Finished(why):
                return [Decision(why), self._rest(computing=not self._checking)]
            case Enough():
                return self._enough(before)
            case Redo():
                return self._redo(before)
            case Resumed():
                return self._resumed(before)
            case Learnt() | Tried() | Checked():
                return self._answered(event)
            case Stopped(why, remedy):
                return [Decision(why, remedy), self._rest()]
            case Abort():
                return [Decision(ABORTED, START_AGAIN), self._rest()]
            case SourceEnded(why):
                return self._ended(before, why)
            case Fitted(verdict):
                return [Decision(f"the calibration is {verdict}")]
            case Written(names):
                return [Decision(f"wrote {', '.join(names)}")]

    def _measured(self, event: Measured) -> list[Output]:
        samples = event.samples
        # After a long silence the person starts the present prompt again, and its time limit starts again, too.
        first_s, last_s = float(samples.t[0]), float(samples.t[-1])
        before_s = first_s if self._sampled_s is None else self._sampled_s
        silent = first_s - before_s > SILENT_S or (
            last_s - first_s > SILENT_S and float(np.diff(samples.t).max()) > SILENT_S
        )
        again = self._step.resumed() if silent else []
        self._sampled_s, self._away_s = last_s, 0.0
        self._samples += len(samples)
        meters = self._watch.add(samples, self._step.wanted) if self._watch else []
        return [*again, *meters, *self._dispatch(self._step.add(samples))]

    def _rest(self, computing: bool = False) -> Prompt:
        also = " The calibration is being computed." if computing else ""
        return Prompt(PromptKind.REST, f"You can put the {name_board(self._board or BOARD)} down.{also}")

    def _turn(self, flat: Rested) -> list[Output]:
        turning = (
            CheckPoses(flat, self._board)
            if self._checking
            else Rotate(flat, self._aim, self._until_end, self._tilt_only, self._board)
        )
        self._step = turning
        return [turning.prompt]

    def _verify(self) -> list[Output]:
        if not isinstance(self._step, Rotate):
            raise TypeError("the board is verified after it was turned")
        verify = Verify(
            self._step.flat,
            self._aim,
            self._step.coverage,
            self._step.directions,
            self._tilt_only,
            self._attended,
            self._board,
        )
        self._step = verify
        return verify.begin()

    def _answered(self, event: Learnt | Tried | Checked) -> list[Output]:
        """Pass the answer of a fit to the step that requested it; drop it if that step is over."""
        match event, self._step:
            case Learnt(knowledge, advice), Rotate() as rotate:
                return self._dispatch(rotate.learn(knowledge, advice))
            case Tried(), Verify() as verify:
                return self._dispatch(verify.tried(event))
            case Checked(), Verify() as verify:
                return self._dispatch(verify.check(event))
        return []

    def _dispatch(self, items: Sequence[Output | Rested | Turned | Finished | Stopped]) -> list[Output]:
        """Return the outputs of a step; its events change the state, and add their outputs."""
        outputs: list[Output] = []
        for item in items:
            if isinstance(item, Rested | Turned | Finished | Stopped):
                outputs += self.handle(item)
            else:
                outputs.append(item)
        return outputs

    def _tick(self, t_s: float) -> list[Output]:
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
            return self.handle(Finished(why))
        return self.handle(Stopped(why, "check the wiring, then start again"))

    def _enough(self, state: State) -> list[Output]:
        if state is State.ROTATE:
            return self.handle(Finished(ENOUGH) if self._until_end or self._checking else Turned(ENOUGH))
        if state is State.VERIFY and isinstance(self._step, Verify):
            return self.handle(self._step.enough())
        if state is State.LAY_FLAT and isinstance(self._step, LayFlat):
            rested = self._step.enough()
            return self.handle(rested) if rested else []
        return []

    def _redo(self, state: State) -> list[Output]:
        """Start the turning again: its samples are dropped, those of the flat rest are kept."""
        if state not in (State.ROTATE, State.VERIFY) or self._flat is None:
            return []
        again = Decision("the turning starts again; what was turned so far is discarded")
        return [again, Forget(self._flat_samples, self._samples), *self._turn(self._flat)]

    def _resumed(self, state: State) -> list[Output]:
        self._sampled_s = self._ticked_s = None
        if state is State.ABORTED:
            self._step = LayFlat(self._until_end, self._board)
        return [Decision("the session resumes where it stopped"), *self._step.resumed()]

    def _ended(self, state: State, why: str | None) -> list[Output]:
        if state in (State.ROTATE, State.VERIFY):
            what = f"the source failed while the board was turned ({why})" if why else "the source ended"
            if self._checking:
                return [Decision(f"{what}; checking with the data so far"), self._rest()]
            return [Decision(f"{what}; calibrating with the data so far"), self._rest(computing=True)]
        if why:
            return [Decision(why), self._rest()]
        remedy = "record it again: flat and still first, then turned through varied orientations"
        return [Decision("the source ended before the board was turned", remedy), self._rest()]
