"""Fits while a session goes on, of the samples so far: uncertainties, a first calibration, and its verification."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..calibration import estimate
from ..calibration.checks import find_reasons
from ..calibration.evidence import Evidence
from ..calibration.hypotheses import remove_change
from ..calibration.interim import InterimEstimate, interim_estimate
from ..calibration.masks import with_masks
from ..calibration.next_orientation import next_orientation
from ..calibration.quality import verdict
from ..calibration.verification import new_orientations
from ..data import Mask, Recording, Samples, Sensor, Vector
from ..reasons import KINDS, Reason, reason
from ..rests.flat import Flat, find_flat, flat_statistics
from ..result import error_model
from ..result.calibration import REFUSED
from .aims import directions, select_aim, unseen_rad
from .events import Checked, Event, FitKind, Knowledge, Learnt, Target, Tried, down_of, triple
from .live_verification import CONTRADICTIONS, explain_contradiction, is_much_clipped, judge_verification, select_unseen
from .plan import Plan

CONTRADICTION, CLIPPED = "inconsistent", "gyro_clipped"


class Task(NamedTuple):
    """Work for the fits.

    Attributes
    ----------
    samples : those that arrived since the last task. kind : which fit of all samples so far to compute; None: no fit.
    forget : number of the first sample to drop, with all after it and every fit of them; None: keep all.
    of : see RequestFit.
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
        self._plan, self._target = plan, select_aim(plan.target, sensor).target
        self._store = SampleStore(sensor)
        self._flat: Flat | None = None
        self._known: InterimEstimate | None = None
        # The first calibration, and the number of samples from which it was computed.
        self._tried: Evidence | None = None
        self._tried_count = 0

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
        """Compute the uncertainties so far, from the last estimate on; with `advice`, the orientation to ask for."""
        recording = with_masks(self._store.recording())
        if self._flat is None:
            segment = find_flat(recording)
            if segment is None:
                return None
            self._flat = flat_statistics(recording, segment)
        flat, gravity = self._flat, self._plan.gravity
        self._known = interim_estimate(recording, flat, gravity, self._known)
        down = None
        if advice:
            allowed = directions(down_of(flat.y), self._plan.tilt_only)
            down = allowed[next_orientation(self._known, target_std(self._target), allowed)]
        return Learnt(knowledge(self._known, self._target, float(recording.t[-1]), down), advice)

    def _try(self) -> Event:
        """Compute the first calibration, and keep it for the comparison with new orientations."""
        recording = self._store.recording()
        evidence, _ = estimate(recording, self._plan.model, self._plan.gravity)
        self._tried, self._tried_count = evidence, len(recording)
        reasons = find_reasons(evidence)
        # The rests alone may suffice for an estimate, but its verification needs a sound gyroscope.
        first_verdict = verdict(reasons) if evidence.gyro_fault is None and evidence.is_of_now else REFUSED
        shown = _most_specific_reason(reasons, evidence.recording)
        return Tried(first_verdict, shown and shown.about(recording.sensor.origin))

    def _check(self, of: int) -> Event:
        """Compare the first calibration with the orientations since then, of which it must not have seen `of`."""
        evidence = self._tried
        if evidence is None or evidence.fit is None or evidence.flat is None:
            return Checked((), False, reason("verification_failed", "nothing"))
        recording, first = with_masks(self._store.recording()), evidence.first
        after = recording.part(first, len(recording))
        for change in evidence.gyro_changes:
            after = remove_change(after, evidence.flat, change)
        rests = new_orientations(after, evidence.flat, evidence.fit, self._plan.gravity, self._tried_count - first)
        unseen = select_unseen(rests, evidence, unseen_rad(self._plan.tilt_only))
        contradiction = next((each for each in find_reasons(evidence) if each.code == CONTRADICTION), None)
        return judge_verification(rests, unseen[:of], of, recording, contradiction)


def _most_specific_reason(reasons: list[Reason], recording: Recording) -> Reason | None:
    """Return the reason to show: a fault of the sensor, or clipping, causes contradictions as well and goes first."""

    def rank(each: Reason) -> int:
        if KINDS[each.code].of_the_sensor:
            return 0
        if each.code == CLIPPED and is_much_clipped(recording):
            return 1
        return 2 if each.code in CONTRADICTIONS else 3

    first = min(reasons, key=rank, default=None)
    return explain_contradiction(first, recording) if first is not None and first.code == CONTRADICTION else first


def target_std(target: Target) -> Vector:
    """Return the target's standard deviations (12,): of D, row-major, and of b_a [m/s^2]."""
    D = np.full((3, 3), np.deg2rad(target.misalignment_deg))
    np.fill_diagonal(D, target.gain_pct / 100.0)
    return np.concatenate([D.ravel(), np.full(3, target.bias_mg / error_model.MG_PER_MPS2)])


def knowledge(known: InterimEstimate, target: Target, t_s: float, down: Vector | None) -> Knowledge:
    """Return the event for an estimate at time `t_s`.

    Parameters
    ----------
    down : (3,) the orientation that would help most, if that was asked.
    """
    D = known.theta.D
    stds = (
        error_model.scale_factor_error_std(known.D_std),
        np.nanmax(error_model.misalignment_std(D, known.D_std), axis=1),
        error_model.bias_mg(known.b_a_std),
    )
    limits = target.gain_pct, target.misalignment_deg, target.bias_mg
    progress = [np.clip(limit / np.maximum(std, 1e-9), 0.0, 1.0) for limit, std in zip(limits, stds, strict=True)]
    gain, misalignment, bias = (std.max() for std in stds)
    return Knowledge(
        t_s,
        triple(stds[0]),
        triple(stds[1]),
        triple(stds[2]),
        target,
        triple(progress[0]),
        triple(progress[1]),
        triple(progress[2]),
        overall=float(np.min(progress)),
        down=None if down is None else triple(down),
        words=f"scale factor error {gain:.2g} %, misalignment {misalignment:.2g} deg, bias {bias:.2g} mg (1 sigma)",
        doubt=_doubt(D, known),
    )


def _doubt(D: Vector, known: InterimEstimate) -> str:
    """Return why no sound sensor has these parameters; empty where one may have, or while D is not known well."""
    if known.D_std.max() > 0.02:
        return ""
    gains = np.diag(error_model.sensor_axes(D))
    if np.trace(D) < 1.5 * gains.mean():
        return "the accelerometer's axes do not match the gyroscope's: one is flipped or swapped"
    if (np.abs(np.log2(gains)) > 0.8).all():
        return f"the accelerometer reads {gains.mean():.2g} times gravity: is its range right?"
    return ""


# Faster samples are averaged to this rate, which shows all motion of a hand.
MOST_HZ = 200.0


class SampleStore:
    """Samples so far, with the times that were known when they arrived.

    Parameters
    ----------
    sensor : its rate determines how many samples are averaged.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        rate_hz = sensor.rate_hz or MOST_HZ
        self._size = max(int(rate_hz / MOST_HZ * (1.0 + 1e-6)), 1)
        self._parts: list[Samples] = []
        self._rest = Samples.empty()
        self._gap_next = False

    def add(self, samples: Samples) -> None:
        """Append samples."""
        if self._gap_next and len(samples):
            samples = replace(samples, gap=np.append(True, samples.gap[1:]))
            self._gap_next = False
        if self._size > 1:
            pending = Samples.joined([self._rest, samples])
            used = len(pending) // self._size * self._size
            samples = _means(pending.each(lambda array: array[:used]), self._size)
            self._rest = pending.each(lambda array: array[used:])
        if len(samples):
            self._parts.append(samples)

    def forget(self, first: int) -> None:
        """Drop the added samples from number `first` on, and mark a gap before the next one."""
        self._parts = [self.samples().each(lambda array: array[: first // self._size])]
        self._rest, self._gap_next = Samples.empty(), True

    def recording(self) -> Recording:
        """Return all samples."""
        return Recording(**vars(self.samples()), sensor=self._sensor)

    def samples(self) -> Samples:
        """Return all samples."""
        self._parts = [Samples.joined(self._parts)]
        return self._parts[0]


def _means(samples: Samples, size: int) -> Samples:
    """Return the means of `size` samples each; a gap or clipping of one of them marks the mean."""

    def mean(values: Vector | Mask) -> Any:
        groups = values.reshape(len(values) // size, size, *values.shape[1:])
        return groups.any(1) if values.dtype == bool else groups.mean(1)

    return samples.each(mean)
