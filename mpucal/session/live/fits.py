"""The fits of a session, from the samples so far: what is known, a first calibration, and what verifies it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...calibration import weigh
from ...calibration.checks import found
from ...calibration.evidence import Evidence
from ...calibration.interim import InterimEstimate, interim_estimate
from ...calibration.masks import with_masks
from ...calibration.next_orientation import next_orientation
from ...calibration.quality import verdict
from ...calibration.verification import new_orientations
from ...data import Recording, Samples, Sensor
from ...reasons import KINDS, Reason, reason
from ...rests.flat import Flat, find_flat, flat_statistics
from ..aims import AIMS, directions, unseen_rad
from ..events import Checked, Event, Learnt, Tried, Wish
from ..plan import Plan
from .disagreement import explained, judged, much_clipped
from .knowledge import knowledge, wanted
from .store import SampleStore
from .unseen import unseen

CONTRADICTION, CLIPPED = "inconsistent", "gyro_clipped"


class Task(NamedTuple):
    """What came since the last task, and what is to be done then.

    Attributes
    ----------
    samples : that arrived. wish : what to compute of all there are; None: nothing.
    forget : the samples from this number on are not used, nor what was computed of them; None: all are.
    """

    samples: Samples
    wish: Wish | None = None
    forget: int | None = None


class Fits:
    """Computes one task after another; the answers depend on the tasks alone.

    Parameters
    ----------
    plan : what the session is to do. sensor : what it measures with.
    """

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._plan = plan
        self._store = SampleStore(sensor)
        self._flat: Flat | None = None
        self._known: InterimEstimate | None = None
        self._tried: Evidence | None = None
        self._since = 0

    def do(self, task: Task) -> Event | None:
        """The answer to the task's wish, where there is one."""
        self._store.add(task.samples)
        if task.forget is not None:
            self._store.forget(task.forget)
            self._known, self._tried = None, None
        match task.wish:
            case Wish.KNOW | Wish.ADVISE:
                return self._learnt(task.wish is Wish.ADVISE)
            case Wish.TRY:
                return self._try()
            case Wish.CHECK:
                return self._check()
        return None

    def _learnt(self, advice: bool) -> Event | None:
        recording = with_masks(self._store.recording())
        if self._flat is None:
            segment = find_flat(recording)
            if segment is None:
                return None
            self._flat = flat_statistics(recording, segment)
        flat, gravity = self._flat, self._plan.gravity
        self._known = interim_estimate(recording, flat, gravity, self._known)
        target = AIMS[self._plan.target].target
        down = None
        if advice:
            x, y, z = (-flat.y / np.linalg.norm(flat.y)).tolist()
            allowed = directions((x, y, z), self._plan.tilt_only)
            down = allowed[next_orientation(self._known, wanted(target), allowed)]
        return Learnt(knowledge(self._known, target, float(recording.t[-1]), down), advice)

    def _try(self) -> Event:
        recording = self._store.recording()
        evidence, _ = weigh(recording, self._plan.model, self._plan.gravity)
        self._tried, self._since = evidence, len(recording)
        reasons = found(evidence)
        return Tried(verdict(reasons), _likeliest(reasons, evidence.recording))

    def _check(self) -> Event:
        of = AIMS[self._plan.target].verify
        evidence = self._tried
        if evidence is None or evidence.fit is None or evidence.flat is None:
            return Checked((), False, reason("verification_failed", "nothing"))
        recording: Recording = with_masks(self._store.recording())
        rests = new_orientations(recording, evidence.flat, evidence.fit, self._plan.gravity, self._since)
        new = unseen(rests, evidence, unseen_rad(self._plan.tilt_only))
        contradiction = next((against for against in found(evidence) if against.code == CONTRADICTION), None)
        return judged(rests, new[:of], of, recording, contradiction)


def _likeliest(reasons: list[Reason], recording: Recording) -> Reason | None:
    """The one to be given: what is wrong with the sensor, or was not measured, contradicts itself as well."""

    def rank(against: Reason) -> int:
        if KINDS[against.code].of_the_sensor:
            return 0
        if against.code == CLIPPED and much_clipped(recording):
            return 1
        return 2 if against.code == CONTRADICTION else 3

    first = min(reasons, key=rank, default=None)
    return explained(first, recording) if first is not None and first.code == CONTRADICTION else first
