"""The state of a session's screen: outputs of the session in, one frozen value out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from ..session.events import (
    Caution,
    Countdown,
    Decision,
    Direction,
    Held,
    Knowledge,
    Meter,
    Output,
    Progress,
    Prompt,
    PromptKind,
    Seen,
    Use,
    Verification,
)
from .flat import BOARD, as_seen

# so long it is said what became of the last orientation
TOLD_S = 1.2
TOLD = {Use.TAKEN: "TAKEN", Use.USEFUL: "NOT THAT ONE, BUT USEFUL", Use.SEEN: "SEEN ALREADY"}
# nearer than this the board is held still, and turned no more
NEAR_DEG = 15.0
# a countdown that is not renewed for so long waits for nothing any more
COUNTDOWN_HOLDS_S = 1.0
# at its end the session looks at what is known now, and then says what became of the orientation
DECIDED_S = 2.0
# the part of gravity that an axis must carry to be named: a tilt by 30 degrees towards a corner is named by both axes
WORTH_NAMING = 0.3
HEADLINES = {
    PromptKind.LAY_FLAT: "LAY FLAT",
    PromptKind.ROTATE: "TURN IT",
    PromptKind.VERIFY: "CHECK",
    PromptKind.AGAIN: "AGAIN?",
    PromptKind.REST: "PUT IT DOWN",
}
CONNECTING = "WAIT"


class Moment(StrEnum):
    """What matters this moment: it takes the large letters."""

    CONNECTING = "connecting"
    COUNTING = "counting"
    TOLD = "told"
    STEP = "step"
    POINT = "point"
    TURN = "turn"
    NEAR = "near"


@dataclass(frozen=True)
class View:
    """The latest of everything; times are the session's [s], None where nothing came yet.

    Attributes
    ----------
    board : how it is drawn. seen : the orientations that count, in the order in which they came. verified : since the
        last prompt to turn. notes : decisions and other lines of talk, in order.
    """

    title: str = "mpucal"
    board: str = BOARD
    prompt: Prompt | None = None
    meter: Meter | None = None
    countdown: Countdown | None = None
    progress: Progress | None = None
    knowledge: Knowledge | None = None
    caution: Caution | None = None
    held: Held | None = None
    seen: tuple[Seen, ...] = ()
    verified: tuple[Verification, ...] = ()
    notes: tuple[str, ...] = ()
    begun_s: float | None = None
    now_s: float | None = None

    def after(self, output: Output) -> View:
        """The view once `output` has come."""
        match output:
            case Prompt():
                return self._prompted(output)
            case Decision(why, _):
                return self.noted(why)
            case Meter():
                view = replace(self, meter=output)
            case Countdown():
                view = replace(self, countdown=output)
            case Held():
                view = replace(self, held=output, countdown=None)
            case Progress():
                view = replace(self, progress=output)
            case Knowledge():
                view = replace(self, knowledge=output)
            case Caution():
                view = replace(self, caution=output)
            case Seen():
                # turned anew, they are counted anew
                kept = tuple(s for s in self.seen if s.paused != output.paused or s.number < output.number)
                view = replace(self, seen=(*kept, output))
            case Verification():
                view = replace(self, verified=(*self.verified, output)).noted(output.text)
            case _:  # what the session asks of others
                return self
        return view._at(output.t_s)

    def noted(self, text: str) -> View:
        """The view with a line of talk more."""
        return replace(self, notes=(*self.notes, text))

    @property
    def elapsed_s(self) -> float:
        """Since the first sample."""
        return 0.0 if self.begun_s is None or self.now_s is None else self.now_s - self.begun_s

    @property
    def waiting(self) -> Countdown | None:
        """The countdown that runs: until the board moves or it is not renewed; at its end, until it is told of."""
        if self.countdown is None or self.now_s is None:
            return None
        counts = self.countdown.remaining_s > 0.0
        moved = self.meter is not None and self.meter.t_s > self.countdown.t_s and not self.meter.still
        if counts and moved:
            return None
        return (
            self.countdown if self.now_s - self.countdown.t_s <= (COUNTDOWN_HOLDS_S if counts else DECIDED_S) else None
        )

    @property
    def wanted(self) -> Direction | None:
        """What is to point down, where one orientation is wanted."""
        if self.prompt is None or self.prompt.kind not in (PromptKind.ROTATE, PromptKind.VERIFY):
            return None
        if self.prompt.down is not None or self.prompt.kind is PromptKind.VERIFY or self.knowledge is None:
            return self.prompt.down
        return self.knowledge.down

    @property
    def confirming(self) -> str:
        """What the person is to confirm as they lay the board flat, else nothing."""
        if self.prompt is None or self.prompt.kind is not PromptKind.LAY_FLAT or self.meter is None:
            return ""
        return as_seen(self.meter.down, self.board)

    @property
    def moment(self) -> Moment:
        """What matters now."""
        return self._now[0]

    @property
    def headline(self) -> str:
        """What to do this moment, in a word or two."""
        return self._now[1]

    @property
    def _now(self) -> tuple[Moment, str]:
        """A countdown, what became of an orientation, the step, or the way to the wanted orientation; and its words."""
        if self.prompt is None:
            return Moment.CONNECTING, CONNECTING
        waiting = self.waiting
        if waiting is not None and self.prompt.kind is not PromptKind.REST and self._counts(waiting):
            word = "NEW: HOLD" if waiting.elsewhere else "HOLD"
            word = "STILL" if self.prompt.kind is PromptKind.LAY_FLAT else word
            return Moment.COUNTING, f"{word} {math.ceil(waiting.remaining_s) or ''}".rstrip()
        if self.held is not None and self.now_s is not None and self.now_s - self.held.t_s < TOLD_S:
            return Moment.TOLD, TOLD[self.held.use]
        if self.wanted is None:
            return Moment.STEP, HEADLINES[self.prompt.kind]
        if self.meter is None or self.meter.missing_deg is None:
            return Moment.POINT, f"{axes(self.wanted)} DOWN"
        if self.meter.missing_deg <= NEAR_DEG:
            return Moment.NEAR, "HOLD STILL"
        return Moment.TURN, _way(self.meter.turn)

    def _counts(self, waiting: Countdown) -> bool:
        """Whether the countdown has begun; until then what it waits for is said."""
        return waiting.remaining_s < waiting.of_s and not waiting.paused

    def _prompted(self, prompt: Prompt) -> View:
        goes_on = self.prompt is not None and self.prompt.kind is prompt.kind
        if goes_on:
            return replace(self, prompt=prompt)
        return replace(self, prompt=prompt, countdown=None, progress=None, caution=None, held=None, verified=())

    def _at(self, t_s: float) -> View:
        return replace(self, now_s=t_s, begun_s=t_s if self.begun_s is None else self.begun_s)


def _way(turn: str) -> str:
    """What is missing to the wanted orientation, in large letters: "ROLL LEFT 60"."""
    degrees, _, way = turn.partition(" deg more, ")
    for words, short in ((" it", ""), (" from you", ""), ("to the ", ""), ("toward", "to")):
        way = way.replace(words, short)
    return f"{way} {degrees}".upper()


def axes(down: Direction) -> str:
    """The axes that point down: "+X -Y"."""
    named = [i for i in range(3) if abs(down[i]) >= WORTH_NAMING]
    return " ".join(f"{'+' if down[i] > 0 else '-'}{'XYZ'[i]}" for i in named)
