"""The fits that a session asks for, computed beside its reading loop. Knows no source and no person.

What is asked for after so many samples is brought after a fixed number more, and waited for if it is late: what the
session does then depends on the samples alone, and a replay repeats it to the last bit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ..calibration import weigh
from ..calibration.evidence import Evidence
from ..calibration.knowledge import Known, know, most_helpful
from ..calibration.masks import with_masks
from ..calibration.model import Flat
from ..calibration.quality import judge
from ..calibration.stationary import find_flat, flat_statistics
from ..calibration.verification import unseen_rests
from ..data import Recording, Samples, Sensor
from ..session.aims import AIMS, directions
from ..session.events import Ask, Checked, Event, Learnt, Tried, Wish
from ..session.plan import Plan
from .disagreement import judged
from .knowledge import knowledge, wanted
from .store import Store

CONTRADICTION = "inconsistent"
# So soon the worker gives way to the reading loop, which must miss no FIFO for it; Python's own is ten times as long.
GIVE_WAY_S = 0.0005


@dataclass(frozen=True)
class _Due:
    """An answer, and the number of samples after which it is brought."""

    at: int
    answer: Future[Event | None]


class Live:
    """One session's fits; `close` it in the end.

    Parameters
    ----------
    plan : what the session is to do. sensor : what it measures with.
    """

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._plan, self._rate_hz = plan, sensor.rate_hz or 200.0
        self._store = Store(sensor)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="fit")
        self._gave_way_s = sys.getswitchinterval()
        sys.setswitchinterval(GIVE_WAY_S)
        self._count = 0
        self._due: list[_Due] = []
        # what follows is the worker's own
        self._flat: Flat | None = None
        self._known: Known | None = None
        self._tried: Evidence | None = None
        self._since = 0

    def add(self, samples: Samples) -> None:
        """They arrived."""
        self._store.add(samples)
        self._count += len(samples)

    def ask(self, ask: Ask) -> None:
        """Begin to compute."""
        recording = self._store.recording()
        work: dict[Wish, Callable[[Recording], Event | None]] = {
            Wish.KNOW: lambda r: self._learnt(r, advice=False),
            Wish.ADVISE: lambda r: self._learnt(r, advice=True),
            Wish.TRY: self._try,
            Wish.CHECK: self._check,
        }
        at = self._count + round(ask.wait_s * self._rate_hz)
        self._due.append(_Due(at, self._worker.submit(work[ask.wish], recording)))

    def answers(self) -> Sequence[Event]:
        """What is due by now; waits for what is late."""
        due = [item for item in self._due if item.at <= self._count]
        self._due = [item for item in self._due if item.at > self._count]
        answers = [item.answer.result() for item in due]
        return [answer for answer in answers if answer is not None]

    def forget(self, first: int) -> None:
        """The samples from number `first` on are not used; nor is what was computed of them."""
        for item in self._due:
            item.answer.cancel()
        self._due = []
        self._store.forget(first)
        self._worker.submit(self._forget)

    def close(self) -> None:
        """Stop computing."""
        self._worker.shutdown(wait=True, cancel_futures=True)
        sys.setswitchinterval(self._gave_way_s)

    # The worker's side.

    def _forget(self) -> None:
        self._known, self._tried = None, None

    def _learnt(self, recording: Recording, advice: bool) -> Event | None:
        recording = with_masks(recording)
        if self._flat is None:
            segment = find_flat(recording)
            if segment is None:
                return None
            self._flat = flat_statistics(recording, segment)
        flat, gravity = self._flat, self._plan.gravity
        self._known = know(recording, flat, gravity, self._known)
        target = AIMS[self._plan.target].target
        down = None
        if advice:
            x, y, z = (-flat.y / np.linalg.norm(flat.y)).tolist()
            allowed = directions((x, y, z), self._plan.tilt_only)
            down = allowed[most_helpful(self._known, recording, flat, gravity, wanted(target), allowed)]
        return Learnt(knowledge(self._known, target, float(recording.t[-1]), down), advice)

    def _try(self, recording: Recording) -> Event:
        evidence, _ = weigh(recording, self._plan.model, self._plan.gravity)
        self._tried, self._since = evidence, len(recording)
        quality = judge(evidence)
        # an estimate that contradicts itself does not settle either: that is the truer reason
        reasons = sorted(quality["reasons"], key=lambda reason: reason["code"] != CONTRADICTION)
        first = reasons[0] if reasons else {"code": "", "message": ""}
        return Tried(quality["verdict"], first["message"], first["code"])

    def _check(self, recording: Recording) -> Event:
        of = AIMS[self._plan.target].verify
        evidence = self._tried
        if evidence is None or evidence.fit is None or evidence.flat is None:
            return Checked((), False, "verification_failed", "there is nothing to verify", "turn the board again")
        recording = with_masks(recording)
        rests = unseen_rests(recording, evidence.flat, evidence.fit, self._plan.gravity, self._since)
        reasons = judge(evidence)["reasons"]
        contradiction = next((reason["message"] for reason in reasons if reason["code"] == CONTRADICTION), "")
        return judged(rests[:of], of, recording, contradiction)
