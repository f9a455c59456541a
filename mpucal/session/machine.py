"""A guided session: events in, prompts, progress and decisions out. Knows no clock, device or screen."""

from __future__ import annotations

from collections.abc import Sequence

from . import lay_flat, rotate
from .events import (
    Abort,
    Connected,
    Decision,
    Enough,
    Event,
    Fitted,
    Measured,
    Output,
    Prompt,
    PromptKind,
    Rested,
    SourceEnded,
    Stopped,
    Tick,
    Turned,
    Written,
)
from .table import State, next_state

SILENT_S = 5.0

REST = Prompt(PromptKind.REST, "You can put the board down.")
ABORTED = "the session was interrupted"
START_AGAIN = "start again when you are ready"


class Machine:
    """Leads through the states of the table, and says what the person is to do.

    Parameters
    ----------
    until_end : each step takes its time, and turning ends with the source.
    """

    def __init__(self, until_end: bool = False) -> None:
        self.state = State.CONNECT
        self._until_end = until_end
        self._lay_flat = lay_flat.LayFlat(patient=until_end)
        self._rotate: rotate.Rotate | None = None
        self._sampled_s: float | None = None

    def handle(self, event: Event) -> list[Output]:
        """Take one event, and answer it.

        Raises
        ------
        IllegalEvent : the event cannot happen in this state, which stays as it was.
        """
        before, self.state = self.state, next_state(self.state, event)
        match event:
            case Measured(samples) if len(samples):
                self._sampled_s = float(samples.t[-1])
                return self._follow(self._step().add(samples))
            case Tick(t_s):
                return self._tick(t_s)
            case Connected():
                return [lay_flat.PROMPT]
            case Rested(still_s, acc):
                self._rotate = rotate.Rotate(acc, self._until_end)
                return [Decision(f"flat and still for {still_s:.0f} s: that will do"), rotate.PROMPT]
            case Turned(why):
                return [Decision(why), REST]
            case Enough():
                return self._enough(before)
            case Stopped(why, remedy):
                return [Decision(why, remedy), REST]
            case Abort():
                return [Decision(ABORTED, START_AGAIN), REST]
            case SourceEnded(why):
                return self._ended(before, why)
            case Fitted(verdict):
                return [Decision(f"the calibration is {verdict}")]
            case Written(names):
                return [Decision(f"wrote {', '.join(names)}")]
        return []

    def _step(self) -> lay_flat.LayFlat | rotate.Rotate:
        return self._rotate or self._lay_flat

    def _follow(self, found: Sequence[Output | Rested | Turned | Stopped]) -> list[Output]:
        outputs: list[Output] = []
        for item in found:
            if isinstance(item, Rested | Turned | Stopped):
                outputs += self.handle(item)
            else:
                outputs.append(item)
        return outputs

    def _tick(self, t_s: float) -> list[Output]:
        if self._sampled_s is None:
            self._sampled_s = t_s
        if t_s - self._sampled_s < SILENT_S:
            return []
        why = f"the sensor sent no samples for {SILENT_S:.0f} s"
        if self._rotate:
            return self.handle(Turned(why))
        return self.handle(Stopped(why, "check the wiring, then start again"))

    def _enough(self, state: State) -> list[Output]:
        if state is State.ROTATE:
            return [Decision("you said that is enough"), REST]
        rested = self._lay_flat.enough() if state is State.LAY_FLAT else None
        return self.handle(rested) if rested else []

    def _ended(self, state: State, why: str | None) -> list[Output]:
        if state is State.ROTATE:
            what = f"the source failed while you turned the board ({why})" if why else "the source ended"
            return [Decision(f"{what}; calibrating with what it gave"), REST]
        if why:
            return [Decision(why), REST]
        return [
            Decision(
                "the source ended before the board was turned",
                "record it again: flat and still first, then turned through varied orientations",
            ),
            REST,
        ]
