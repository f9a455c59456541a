"""Fits of a session, from the samples so far: uncertainties, a first calibration, and its verification."""

from __future__ import annotations

from typing import NamedTuple

from ...calibration import estimate
from ...calibration.checks import find_reasons
from ...calibration.evidence import Evidence
from ...calibration.interim import InterimEstimate, interim_estimate
from ...calibration.masks import with_masks
from ...calibration.next_orientation import next_orientation
from ...calibration.quality import verdict
from ...calibration.verification import new_orientations
from ...data import Recording, Samples, Sensor
from ...reasons import KINDS, Reason, reason
from ...rests.flat import Flat, find_flat, flat_statistics
from ...result.calibration import REFUSED
from ..aims import AIMS, directions, unseen_rad
from ..events import Checked, Event, FitKind, Learnt, Tried, down_of
from ..plan import Plan
from .knowledge import knowledge, target_std
from .store import SampleStore
from .verification import explain_contradiction, is_much_clipped, judge_verification, select_unseen

CONTRADICTION, CLIPPED = "inconsistent", "gyro_clipped"


class Task(NamedTuple):
    """Work for the fits.

    Attributes
    ----------
    samples : those that arrived since the last task. kind : the fit of all samples so far; None: no fit.
    forget : drop the samples from this number on, and every fit of them; None: keep all. of : see RequestFit.
    """

    samples: Samples
    kind: FitKind | None = None
    forget: int | None = None
    of: int = 0


class Fits:
    """Live fits of one session; their answers depend on the tasks alone.

    Parameters
    ----------
    plan : the session's settings. sensor : the sensor that it measures with.
    """

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._plan = plan
        self._store = SampleStore(sensor)
        self._flat: Flat | None = None
        self._known: InterimEstimate | None = None
        self._tried: Evidence | None = None
        self._since = 0

    def do(self, task: Task) -> Event | None:
        """Execute a task; return the answer, or None if it asks for no fit or the board has not lain flat yet."""
        self._store.add(task.samples)
        if task.forget is not None:
            self._store.forget(task.forget)
            self._known, self._tried = None, None
        match task.kind:
            case FitKind.KNOW | FitKind.ADVISE:
                return self._learnt(task.kind is FitKind.ADVISE)
            case FitKind.TRY:
                return self._try()
            case FitKind.CHECK:
                return self._check(task.of)
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
            allowed = directions(down_of(flat.y), self._plan.tilt_only)
            down = allowed[next_orientation(self._known, target_std(target), allowed)]
        return Learnt(knowledge(self._known, target, float(recording.t[-1]), down), advice)

    def _try(self) -> Event:
        recording = self._store.recording()
        evidence, _ = estimate(recording, self._plan.model, self._plan.gravity)
        self._tried, self._since = evidence, len(recording)
        reasons = find_reasons(evidence)
        # The rests may suffice for an estimate; without a gyroscope nothing can be verified.
        told = verdict(reasons) if evidence.gyroscope is None else REFUSED
        return Tried(told, _most_specific_reason(reasons, evidence.recording))

    def _check(self, of: int) -> Event:
        evidence = self._tried
        if evidence is None or evidence.fit is None or evidence.flat is None:
            return Checked((), False, reason("verification_failed", "nothing"))
        recording = with_masks(self._store.recording())
        rests = new_orientations(recording, evidence.flat, evidence.fit, self._plan.gravity, self._since)
        unseen = select_unseen(rests, evidence, unseen_rad(self._plan.tilt_only))
        contradiction = next((against for against in find_reasons(evidence) if against.code == CONTRADICTION), None)
        return judge_verification(rests, unseen[:of], of, recording, contradiction)


def _most_specific_reason(reasons: list[Reason], recording: Recording) -> Reason | None:
    """Return the reason to show: a fault of the sensor, or clipping, causes contradictions as well and goes first."""

    def rank(against: Reason) -> int:
        if KINDS[against.code].of_the_sensor:
            return 0
        if against.code == CLIPPED and is_much_clipped(recording):
            return 1
        return 2 if against.code == CONTRADICTION else 3

    first = min(reasons, key=rank, default=None)
    return explain_contradiction(first, recording) if first is not None and first.code == CONTRADICTION else first
