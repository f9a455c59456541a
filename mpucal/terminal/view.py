"""State of a session's screen: outputs of the session in, one frozen value out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

from ..session import events
from ..session.attitude import rotate
from ..session.boards import BOARD, flat_description
from ..session.step import HAND_WINDOW_S, WANTED_RAD

# Time for which the headline shows the use of the last orientation before the next turn. A word is read in 0.25 s (240
# words a minute); "taken" also has a tone, and a mark that stays.
USE_SHOWN_S = {events.Use.TAKEN: 0.5, events.Use.USEFUL: 1.2, events.Use.SEEN: 1.2}
USE_HEADLINES = {
    events.Use.TAKEN: "TAKEN",
    events.Use.USEFUL: "NOT THAT ONE, BUT USEFUL",
    events.Use.SEEN: "SEEN ALREADY",
}
# The headline asks to hold still within NEAR_DEG of the wanted orientation, or within NEAR_HELD_DEG if the board turns
# more slowly than RESTS_DPS: between two meters it then moves by no more than the difference of the two angles. A board
# that turns faster than PASSES_DPS passes by the orientation.
RESTS_DPS, PASSES_DPS = 20.0, 70.0
NEAR_DEG = math.degrees(WANTED_RAD)
NEAR_HELD_DEG = NEAR_DEG + RESTS_DPS * HAND_WINDOW_S
# A countdown that is not renewed for this time has ended; for the second one, if the board moves.
COUNTDOWN_HOLDS_S, BUMP_S = 1.0, 0.4
# Time for which a useful orientation is held before the headline asks to hold it instead of the wanted one.
PREFERRED_S = 0.4
# Time from the end of a countdown until the session has decided about the orientation.
DECIDED_S = 2.0
HEADLINES = {
    events.PromptKind.LAY_FLAT: "LAY FLAT",
    events.PromptKind.ROTATE: "TURN IT",
    events.PromptKind.VERIFY: "CHECK",
    events.PromptKind.AGAIN: "AGAIN?",
    events.PromptKind.REST: "PUT IT DOWN",
}
CONNECTING = "WAIT"
# Prompts that ask for one orientation.
TURNING = (events.PromptKind.ROTATE, events.PromptKind.VERIFY)


# Directions [deg] from which a board is drawn, in the order of preference. A new direction must show at least the share
# LEAST_FACE of the board's face; the present one is kept down to KEPT_FACE, so that a tremor does not change it.
_TURNS_DEG, _TILTS_DEG = (-14.0, 14.0, -28.0, 28.0, -48.0, 48.0), (32.0, 52.0, 16.0, 68.0)
LEAST_FACE, KEPT_FACE = 0.5, 0.38


class Eye(NamedTuple):
    """Direction from which the board is seen, in the terminal and on the page: turned from the front, and above."""

    turn_deg: float = _TURNS_DEG[0]
    tilt_deg: float = _TILTS_DEG[0]

    @property
    def axes(self) -> tuple[events.Direction, events.Direction, events.Direction]:
        """Unit vectors of the room across, up and toward the eye."""
        turn, tilt = math.radians(self.turn_deg), math.radians(self.tilt_deg)
        x, y = math.sin(turn), math.cos(turn)
        up = (x * math.sin(tilt), y * math.sin(tilt), math.cos(tilt))
        return (y, -x, 0.0), up, (-x * math.cos(tilt), -y * math.cos(tilt), math.sin(tilt))

    def moved(self, attitudes: Sequence[events.Quaternion]) -> Eye:
        """Return the eye for a board in these attitudes: this one, unless it sees one of them nearly edge-on."""
        faces = [rotate(attitude, (0.0, 0.0, 1.0)) for attitude in attitudes]

        def share(eye: Eye) -> float:
            return min(abs(dot(eye.axes[2], face)) for face in faces)

        if share(self) >= KEPT_FACE:
            return self
        eyes = [Eye(turn, tilt) for tilt in _TILTS_DEG for turn in _TURNS_DEG]
        return next((eye for eye in eyes if share(eye) >= LEAST_FACE), max(eyes, key=share))


FRONT = Eye()


def dot(a: events.Direction, b: events.Direction) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class Moment(StrEnum):
    """Subject of the headline."""

    CONNECTING = "connecting"
    COUNTING = "counting"
    DECIDED = "decided"
    STEP = "step"
    TURN = "turn"
    NEAR = "near"


@dataclass(frozen=True)
class View:
    """Latest output of each kind; times are the session's [s], None before the first.

    Attributes
    ----------
    board : kind of picture. eye : from where it is seen. seen : orientations that count, in their order.
    verified : those since the last prompt to turn. notes : decisions and other messages, in their order.
    """

    title: str = "mpucal"
    board: str = BOARD
    eye: Eye = FRONT
    prompt: events.Prompt | None = None
    meter: events.Meter | None = None
    countdown: events.Countdown | None = None
    progress: events.Progress | None = None
    knowledge: events.Knowledge | None = None
    caution: events.Caution | None = None
    held: events.Held | None = None
    seen: tuple[events.Seen, ...] = ()
    verified: tuple[events.Verification, ...] = ()
    notes: tuple[str, ...] = ()
    begun_s: float | None = None
    now_s: float | None = None

    def after(self, output: events.Output) -> View:
        """Return the view after another output."""
        match output:
            case events.Prompt():
                return self._prompted(output)
            case events.Decision(why, _):
                return self.noted(why)
            case events.Meter():
                laying = self.prompt is not None and self.prompt.kind is events.PromptKind.LAY_FLAT
                wanted = events.LAID if laying else output.wanted or output.attitude
                view = replace(self, meter=output, eye=self.eye.moved((output.attitude, wanted)))
            case events.Countdown() | events.Progress() | events.Knowledge() | events.Caution():
                latest: dict[str, Any] = {type(output).__name__.lower(): output}
                view = replace(self, **latest)
            case events.Held():
                view = replace(self, held=output, countdown=None)
            case events.Seen():
                # Numbers start again with the turning.
                kept = tuple(s for s in self.seen if s.paused != output.paused or s.number < output.number)
                view = replace(self, seen=(*kept, output))
            case events.Verification():
                view = replace(self, verified=(*self.verified, output)).noted(output.text)
            case _:
                # A command is not shown.
                return self
        return view._at(output.t_s)

    def noted(self, text: str) -> View:
        """Return the view with another message."""
        return replace(self, notes=(*self.notes, text))

    @property
    def elapsed_s(self) -> float:
        """Time since the first sample [s]."""
        return 0.0 if self.begun_s is None or self.now_s is None else self.now_s - self.begun_s

    @property
    def waiting(self) -> events.Countdown | None:
        """Countdown that runs, until the board moves or it is not renewed; after its end, until the decision."""
        if self.countdown is None or self.now_s is None:
            return None
        counts = self.countdown.remaining_s > 0.0
        moved = self.meter is not None and self.meter.t_s > self.countdown.t_s + BUMP_S and not self.meter.still
        age_s = self.now_s - self.countdown.t_s
        over = (counts and moved) or age_s > (COUNTDOWN_HOLDS_S if counts else DECIDED_S)
        return None if over else self.countdown

    @property
    def wanted(self) -> events.Direction | None:
        """Unit vector that is to point down, if one orientation is wanted."""
        if self.prompt is None or self.prompt.kind not in TURNING:
            return None
        if self.prompt.down is not None or self.prompt.kind is events.PromptKind.VERIFY or self.knowledge is None:
            return self.prompt.down
        return self.knowledge.down

    @property
    def line(self) -> tuple[int, int]:
        """Finish line of this step: the number of orientations that are taken, and how many there are to be.

        The progress counts an orientation from the moment at which the board is still there.
        """
        p = self.progress
        if p is None or self.prompt is None or self.prompt.kind not in TURNING:
            return 0, 0
        done = int(p.done)
        if self.prompt.kind is events.PromptKind.ROTATE:
            held = self.waiting
            held_s = math.inf if held is None else held.t_s + held.remaining_s - held.of_s
            # The first one is flat.
            done = min(done, 1 + sum(seen.paused and seen.t_s < held_s for seen in self.seen))
        return done, int(p.of)

    @property
    def confirming(self) -> str:
        """Question to confirm while the board is laid flat, else empty."""
        if self.prompt is None or self.prompt.kind is not events.PromptKind.LAY_FLAT or self.meter is None:
            return ""
        return flat_description(self.meter.down, self.board)

    @property
    def moment(self) -> Moment:
        """Subject of the headline."""
        return self._now[0]

    @property
    def headline(self) -> str:
        """Instruction of this moment, in a few words."""
        return self._now[1]

    @property
    def _now(self) -> tuple[Moment, str]:
        if self.prompt is None:
            return Moment.CONNECTING, CONNECTING
        waiting = self.waiting
        # Before the countdown begins, the headline says what to do for it.
        held_s = waiting.of_s - waiting.remaining_s if waiting is not None and not waiting.paused else 0.0
        counting = held_s > (PREFERRED_S if waiting is not None and waiting.elsewhere else 0.0)
        if waiting is not None and counting and self.prompt.kind is not events.PromptKind.REST:
            word = "NEW: HOLD" if waiting.elsewhere else "HOLD"
            word = "STILL" if self.prompt.kind is events.PromptKind.LAY_FLAT else word
            return Moment.COUNTING, f"{word} {math.ceil(waiting.remaining_s) or ''}".rstrip()
        if self.held is not None and self.now_s is not None and self.now_s - self.held.t_s < USE_SHOWN_S[self.held.use]:
            return Moment.DECIDED, USE_HEADLINES[self.held.use]
        if self.wanted is None or self.meter is None or self.meter.missing_deg is None:
            return Moment.STEP, HEADLINES[self.prompt.kind]
        near_deg = NEAR_HELD_DEG if self.meter.turning_dps < RESTS_DPS else NEAR_DEG
        if not self.meter.turn or (self.meter.missing_deg <= near_deg and self.meter.turning_dps < PASSES_DPS):
            return Moment.NEAR, "HOLD STILL"
        return Moment.TURN, _turn_headline(self.meter.turn)

    def _prompted(self, prompt: events.Prompt) -> View:
        if self.prompt is not None and self.prompt.kind is prompt.kind:
            return replace(self, prompt=prompt)
        meter = self.meter
        if meter is not None and prompt.kind not in TURNING:
            # There may be no further meter.
            meter = meter._replace(missing_deg=None, turn="", wanted=None)
        view = replace(self, prompt=prompt, meter=meter)
        # The headline still shows that the last orientation was taken, although the next step has begun.
        held = self.held if prompt.kind in TURNING else None
        return replace(view, countdown=None, progress=None, caution=None, held=held, verified=())

    def _at(self, t_s: float) -> View:
        if self.begun_s is None or self.now_s is None:
            return replace(self, now_s=t_s, begun_s=t_s)
        # Results that were computed from earlier samples arrive late.
        return replace(self, now_s=max(t_s, self.now_s))


def _turn_headline(turn: str) -> str:
    """Return a turn in few letters: "60 deg more, roll it to the left" becomes "ROLL LEFT 60"."""
    degrees, _, words = turn.partition(" deg more, ")
    for long, short in ((" it", ""), (" from you", ""), ("to the ", ""), ("toward", "to")):
        words = words.replace(long, short)
    return f"{words} {degrees}".upper()
