"""Trial of a session's guidance: simulated hands of every kind, and one that only follows the words.

python -m tools.lab guidance_trials --seeds 20
python -m tools.lab guidance_trials --seeds 20 --hand wandering

Counted over whole sessions on the simulated chip, as the page shows them: pictures that jump by more than 20 deg beyond
what gravity and the gyroscope turned meanwhile (the board's, and where the wanted one is drawn), a HOLD farther from
the wanted orientation than 15 deg that is not said to be useful, an orientation asked for in place of another without a
word on what was held, and counts above their total. In the transcript of what is said and played: "hold"
and "turn" that contradict each other within a second, a tone for wrong before a hold that is taken, words said twice
within five seconds, and words while the board is held. Then the time to the verdict of the hand that is given the
wanted orientation is compared with that of one that turns the board as the page says in words, by so many degrees, and
looks again.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from mpucal.data import Vector
from mpucal.page.feed import state
from mpucal.result.calibration import GOOD
from mpucal.session.events import Countdown, Held, Key, Meter, Output, Progress, Prompt, PromptKind, Use
from mpucal.session.meter import TURN_WORDS
from mpucal.session.plan import Plan
from mpucal.session.step import SAY_AGAIN_S
from mpucal.simulated import rotation as quaternions
from mpucal.simulated.hand import IN_THE_HAND, MISS_RAD, ON_THE_TABLE, REACTION_S, Stance
from mpucal.simulated.hands import HANDS, Guided
from mpucal.simulated.legs import STEP_S, Leg
from mpucal.terminal.view import NEAR_DEG, Moment, View
from mpucal.terminal.voice import HOLD, SETTLED_S, Announcement, Tone, Voice

from .runner import Trial, each_seed
from .sessions import session
from .table import Column, Row, count, grouped, known

BEYOND_DEG = 20.0
COUNT = re.compile(r"(\d+) of (\d+)")
BY_WORDS = "by words"
LOOKS_S = 0.25
SLOWEST = 1.2


class WordFollower(Guided):
    """Turns the board as it is told in words, seen from where it laid the board flat, and looks again.

    Its motion is computed some time ahead: it reacts to words from when they were shown (`SINCE_S`).
    """

    HEADLINE, DEGREES, SINCE_S = "", 0.0, 0.0

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(rng)
        self._room: Vector | None = None
        self._words, self._due_s, self._turned_s = "", math.inf, 0.0

    def rotate(self, now: Stance) -> Leg:
        """Turn as the announcements say, a reaction time later; hold still without one."""
        if self._room is None or now.grip == ON_THE_TABLE:
            self._room = now.attitude
        way = self.HEADLINE.lower()
        t_s = now.step * STEP_S
        if way not in TURN_WORDS:
            self._words = ""
            return self.pause(now, LOOKS_S)
        if way != self._words:
            said_s = self.SINCE_S if self._turned_s < self.SINCE_S else t_s
            self._words, self._due_s = way, said_s + self._rng.uniform(*REACTION_S)
        if t_s + STEP_S < self._due_s:
            return self.pause(now, min(LOOKS_S, self._due_s - t_s))
        self._words = ""
        toward = TURN_WORDS.index(way) * math.pi / 4.0
        axis = np.array([0.0, -math.sin(toward), math.cos(toward), 0.0])
        for q in (self._room, quaternions.conjugate(now.attitude)):
            axis = quaternions.product(quaternions.product(q, axis), quaternions.conjugate(q))
        miss = self._rng.normal(size=3)
        miss *= MISS_RAD * math.sqrt(self._rng.uniform()) / np.linalg.norm(miss)
        leg = self.move(now, math.radians(self.DEGREES) * axis[1:] + miss, IN_THE_HAND)
        self._turned_s = leg.last * STEP_S
        return leg


HANDS[BY_WORDS] = WordFollower
STAY, GO = "stay", "go"
SENSES = {Moment.COUNTING: STAY, Moment.NEAR: STAY, Moment.TURN: GO}


@dataclass
class Transcript:
    """Transcript of what a person hears and sees, with times, and the number of contradictions in it.

    Attributes
    ----------
    said : announcements, with the moment of each.
    """

    said: list[tuple[Announcement, Moment]] = field(default_factory=list)
    wrong: Counter[str] = field(default_factory=Counter)
    voice: Voice = field(default_factory=Voice)

    def hear(self, view: View) -> None:
        """Follow a change of the view."""
        self.voice.hear(view)
        now = self.voice.said
        if now is None or (self.said and now is self.said[-1][0]):
            return
        if self.said:
            self._compare(*self.said[-1], now, view)
        self.said.append((now, view.moment))

    def _compare(self, last: Announcement, moment: Moment, now: Announcement, view: View) -> None:
        after_s = now.t_s - last.t_s
        senses = SENSES.get(moment), SENSES.get(view.moment)
        opposite = senses in ((STAY, GO), (GO, STAY)) and bool(last.words and now.words)
        self.wrong["contradicted within a second"] += opposite and after_s < SETTLED_S
        self.wrong["wrong before taken"] += last.tone is Tone.WRONG and now.tone is Tone.TAKEN
        self.wrong["said twice"] += last.words == now.words and after_s < SAY_AGAIN_S
        turning = view.prompt is not None and view.prompt.kind is not PromptKind.LAY_FLAT
        holding = turning and moment is view.moment is Moment.COUNTING
        self.wrong["said while holding"] += holding and view.held is None


@dataclass
class Watcher:
    """Observer of the page that counts its faults."""

    view: View = field(default_factory=View)
    wrong: Counter[str] = field(default_factory=Counter)
    transcript: Transcript = field(default_factory=Transcript)
    holds: int = 0
    told: bool = True
    finished_s: float = math.nan

    def hear(self, output: Output) -> None:
        """Check the page after this output."""
        before, self.view = self.view, self.view.after(output)
        self.transcript.hear(self.view)
        shown = state(self.view)
        if shown["moment"] in (Moment.COUNTING, Moment.TURN, Moment.NEAR):
            self._since_counted = shown["moment"]
        match output:
            case Meter():
                if shown["headline"] != WordFollower.HEADLINE:
                    WordFollower.HEADLINE, WordFollower.SINCE_S = shown["headline"], output.t_s
                WordFollower.DEGREES = 5.0 * round((output.missing_deg or 0.0) / 5.0)
                self._jumps(before, output)
                self._hold(shown["headline"], output)
            case Prompt(kind=kind):
                turning = kind in (PromptKind.ROTATE, PromptKind.VERIFY)
                if turning and before.prompt is not None and before.prompt.kind is kind:
                    self.wrong["changed without a word"] += output.down != before.prompt.down and not self.told
                self.told = self.told and not turning
                if kind is PromptKind.REST:
                    self.finished_s = self.view.now_s or math.nan
            case Held(use=use):
                self.told = True
                self.wrong["wrong before taken"] += use is Use.TAKEN and self._since_counted != Moment.COUNTING
                self.wrong["not told"] += shown["moment"] != Moment.DECIDED
            case Countdown():
                self.holds += state(before)["moment"] != "counting" == shown["moment"]
            case Progress(done=done, of=of, text=text):
                counts = [tuple(map(int, found)) for found in COUNT.findall(text)]
                self.wrong["counts above their total"] += done > of or any(a > b for a, b in counts)

    def pressed(self) -> Sequence[Key]:
        """Press nothing."""
        return ()

    def _jumps(self, before: View, meter: Meter) -> None:
        if before.meter is None:
            return
        last = before.meter
        gravity = math.degrees(math.acos(min(1.0, float(np.dot(last.down, meter.down)))))
        own = gravity + (meter.t_s - last.t_s) * max(last.turning_dps, meter.turning_dps)
        self.wrong["jumps of the board"] += angle(last.attitude, meter.attitude) > own + BEYOND_DEG
        if last.wanted is None or meter.wanted is None or self._same is not before.prompt:
            self._same = before.prompt
            return
        self.wrong["jumps of the wanted one"] += angle(last.wanted, meter.wanted) > own + BEYOND_DEG

    _same: Prompt | None = None
    _since_counted = ""

    def _hold(self, headline: str, meter: Meter) -> None:
        if self.view.wanted is None or meter.missing_deg is None or headline != HOLD:
            return
        # gravity decides; after a turn beyond the gyroscope's range the attitude needs half a second to follow it
        missing = math.degrees(math.acos(max(-1.0, min(1.0, float(np.dot(meter.down, self.view.wanted))))))
        self.wrong["hold far away"] += min(missing, meter.missing_deg) > NEAR_DEG + 5.0


def angle(a: Any, b: Any) -> float:
    """Return the angle [deg] between two attitudes, quaternions (4,)."""
    return math.degrees(2.0 * math.acos(min(1.0, abs(float(np.dot(a, b))))))


def of_hand(item: tuple[str, int]) -> Row:
    """Watch a session in a hand: how it ended, and the faults of its guidance."""
    hand, seed = item
    watcher = Watcher()
    verdict = session(f"sim:hand={hand}", Plan(), seed, watcher).judged().verdict
    wrong = watcher.wrong + watcher.transcript.wrong
    return Row(name=hand, verdict=verdict, finished_s=watcher.finished_s, holds=watcher.holds, wrong=wrong)


def typical_s(trials: Sequence[Row]) -> float:
    """Return the median time to the verdict of good sessions [s]."""
    return float(np.median(known((t for t in trials if t.verdict == GOOD), "finished_s") or [math.nan]))


def total_wrong(trials: Sequence[Row]) -> Counter[str]:
    """Return the faults, and how often each occurred."""
    return sum((trial.wrong for trial in trials), Counter())


COLUMNS: dict[str, Column] = {
    "sessions": len,
    "good": count("verdict", GOOD),
    "median s": typical_s,
    "holds": lambda trials: sum(trial.holds for trial in trials),
    "wrong": lambda trials: ", ".join(f"{n} {what}" for what, n in total_wrong(trials).items()) or "nothing",
}


def scenarios(*, seeds: range, hand: Annotated[Sequence[str], HANDS] = tuple(HANDS)) -> list[tuple[str, int]]:
    """Return each hand with each seed."""
    return each_seed(hand, seeds)


def report(trials: list[Row]) -> int:
    """Print how long the words alone take; return 1 after a fault, or if that is too long."""
    by_hand = grouped(trials, "name")
    ratio = typical_s(by_hand.get(BY_WORDS, [])) / typical_s(by_hand.get("guided", []))
    print(f"by words in {ratio:.2f} times the time of the hand that is given the orientation")
    return 1 if total_wrong(trials) or ratio > SLOWEST else 0


main = Trial(__doc__, of_hand, scenarios, COLUMNS, report=report)
