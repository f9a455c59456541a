"""Voice of a session: the words to be said and the tones to be played, from the views of its screen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from ..session.events import Caution, Held, Prompt, PromptKind, Use
from ..session.step import SAY_AGAIN_S
from .view import HEADLINES, USE_HEADLINES, Moment, View

CONNECTING = "Connecting"
HOLD = "Hold still"
# Time for which a change of the moment must last before the voice says something that contradicts its last words.
SETTLED_S = 1.0


class Tone(StrEnum):
    """Tones, by their meaning."""

    NONE = ""
    HOLD = "hold"
    TAKEN = "taken"
    WRONG = "wrong"


@dataclass(frozen=True)
class Announcement:
    """Announcement number `number`, at the session's time `t_s`: its words, and the tone before them."""

    number: int
    t_s: float
    words: str
    tone: Tone


def in_words(view: View) -> str:
    """Return what to do at this moment, without numbers."""
    match view.moment:
        case Moment.COUNTING if view.countdown is not None and view.countdown.elsewhere:
            return f"New: {HOLD.lower()}"
        case Moment.COUNTING | Moment.NEAR:
            return HOLD
        case Moment.DECIDED if view.held is not None:
            return USE_HEADLINES[view.held.use].capitalize()
        case Moment.TURN if view.meter is not None:
            words = view.meter.turn.rpartition(", ")[2]
            return words[:1].upper() + words[1:]
        case Moment.STEP if view.prompt is not None:
            return HEADLINES[view.prompt.kind].capitalize()
    return CONNECTING


class Voice:
    """Voice that follows the views of one session.

    It is silent between "hold" and "taken". Words that contradict the last ones wait until their cause has lasted
    SETTLED_S.

    Attributes
    ----------
    said : last announcement; None before the first.
    """

    def __init__(self) -> None:
        self.said: Announcement | None = None
        self._moment = self._spoken = Moment.CONNECTING
        self._since_s = self._t_s = 0.0
        self._held: Held | None = None
        self._caution: Caution | None = None
        self._prompt: Prompt | None = None

    def hear(self, view: View) -> None:
        """Follow a change of the view."""
        moment, self._t_s = view.moment, view.now_s or 0.0
        if moment is not self._moment:
            self._moment, self._since_s = moment, self._t_s
        if view.held is not self._held:
            self._held = view.held
            if view.held is not None:
                self._say(view.held.text, Tone.WRONG if view.held.use is Use.SEEN else Tone.TAKEN)
                return
        if view.caution is not self._caution and self._may_caution(view):
            self._caution = view.caution
            if view.caution is not None and self._t_s - view.caution.t_s < SAY_AGAIN_S:
                self._say(f"{view.caution.what}. {view.caution.do}", Tone.WRONG)
                return
        self._instruct(view)

    def _may_caution(self, view: View) -> bool:
        laying = view.prompt is not None and view.prompt.kind is PromptKind.LAY_FLAT
        return self._is_settled or (laying and self._moment is Moment.COUNTING and self._quiet_s >= SETTLED_S)

    @property
    def _quiet_s(self) -> float:
        """Time since the last announcement."""
        return math.inf if self.said is None else self._t_s - self.said.t_s

    @property
    def _is_settled(self) -> bool:
        """True if the board is not held, and for SETTLED_S the moment has not changed and nothing was said."""
        lasts_s = min(self._t_s - self._since_s, self._quiet_s)
        return self._moment not in (Moment.COUNTING, Moment.DECIDED) and lasts_s >= SETTLED_S

    def _instruct(self, view: View) -> None:
        tone = Tone.WRONG if self._spoken is Moment.COUNTING else Tone.NONE
        match self._moment:
            case Moment.COUNTING if self._spoken is Moment.NEAR:
                self._say("", Tone.HOLD)
            case Moment.COUNTING if self._spoken is not Moment.COUNTING and (
                self._spoken is not Moment.TURN or self._quiet_s >= SETTLED_S
            ):
                self._say(view.confirming or in_words(view), Tone.HOLD)
            case Moment.TURN if view.meter is not None and view.meter.turn and view.waiting is None:
                due = self._spoken is not Moment.TURN or view.prompt is not self._prompt or self._quiet_s >= SAY_AGAIN_S
                # The words on the last orientation are not interrupted.
                first = self._spoken is Moment.DECIDED and self._quiet_s >= SETTLED_S
                first = first or self._spoken in (Moment.CONNECTING, Moment.STEP)
                if due and (first or self._is_settled):
                    self._prompt = view.prompt
                    self._say(view.meter.turn.replace(" deg ", " degrees "), tone)
            case Moment.NEAR if self._spoken is not Moment.NEAR and self._is_settled:
                self._say("Hold it still", tone)
            case Moment.STEP if view.prompt is not None and view.prompt is not self._prompt:
                self._prompt = view.prompt
                self._say(view.prompt.text, Tone.NONE)

    def _say(self, words: str, tone: Tone) -> None:
        self._spoken = self._moment
        self.said = Announcement(0 if self.said is None else self.said.number + 1, self._t_s, words, tone)
