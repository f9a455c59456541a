"""Estimation of a recording: with the gyroscope, from the rests alone, or from a part of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..arguments import LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2
from ..data import STANDARD_GRAVITY_MPS2, Recording, Vector
from ..errors import WrongValue
from ..reasons import OF_A_PART, OF_RESTS, Reason
from ..rests.flat import Flat, find_flat, flat_statistics, is_long_enough
from .bias_changes import without_changes
from .checks import CONTRADICTED, NO_GYROSCOPE, OTHER_RANGE, find_gyroscope_fault, find_reasons, is_unusable
from .checks.sensor import is_trustworthy
from .evidence import Evidence
from .hand import HandFit
from .hypotheses import Explanation, explain, gyroscope_change, rank, remove_change, unseen_changes
from .masks import find_reset, with_masks
from .model_selection import METHODS, ModelChoice, fit_model
from .sensitivity import Sensitivity, find_sensitivity
from .static import fit_static
from .transitions import FEWEST_TRANSITIONS
from .uncertainty import claim_uncertainty, inflate
from .words import decode

MODELS = ("auto", *METHODS)
NOTHING = {"why": "nothing could be estimated"}


def estimate(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> tuple[Evidence, Mapping[str, str]]:
    """Estimate as `calibrate` does; return the evidence with the fit, and the model's name with why it was chosen.

    Where the gyroscope is at fault and the rests suffice, the estimate uses the rests alone. Where the sensor changed,
    or reached the end of its range, and the part before or after that is good by itself, it uses that part alone.

    Raises
    ------
    WrongValue : the model does not exist, or the gravity is impossible.
    """
    if model not in tuple(MODELS):  # a tuple, since a caller's value may not be hashable
        raise WrongValue(f"there is no model {model!r}", f"choose one of {', '.join(MODELS)}")
    if not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise WrongValue(f"gravity is {gravity}", "give the local gravity in m/s^2, about 9.81")
    decoded = decode(recording)
    masked = with_masks(decoded.recording)
    before = Evidence(masked, gravity, None, None, model, gravity_anyway=gravity_anyway, decoded=decoded)
    missing = NO_GYROSCOPE.reason(before)
    whole = _with_gyroscope(before) if missing is None else (before, NOTHING | {"model": model})
    if model == "static" and missing is not None:
        return _of_rests(before, missing), {"model": model, "why": "asked for"}
    if model != "auto":
        return whole
    at_fault = find_gyroscope_fault(whole[0])
    if at_fault is None:
        return _of_a_part(whole[0]) or whole
    of_rests = _of_rests(before, at_fault)
    if refusing := tuple(reason for reason in find_reasons(of_rests) if reason.refuse):
        if missing is not None:
            return replace(whole[0], against_rests=refusing), whole[1]
        # Other faults of the gyroscope can be mended. Then the rests need not suffice, and their lack is not reported.
        return _of_a_part(whole[0]) or whole
    if _is_doubtful(whole[0], at_fault, of_rests):
        return _of_a_part(whole[0]) or whole
    if at_fault != OTHER_RANGE.reason(whole[0]) and _is_known_better(whole[0], of_rests):
        return _of_a_part(whole[0]) or whole
    return of_rests, {"model": "static", "why": "the gyroscope is at fault, and the rests are enough without it"}


def _is_doubtful(whole: Evidence, at_fault: Reason, of_rests: Evidence) -> bool:
    """Return True if a slip of the mount may be the reason why the rests contradict the gyroscope.

    Where samples are missing, that explains the contradiction instead; and enough rests would show a slip.
    """
    is_few = of_rests.estimate.freedom < FEWEST_TRANSITIONS
    return is_few and not whole.recording.gap.any() and at_fault == CONTRADICTED.reason(whole)


def _is_known_better(evidence: Evidence, other: Evidence) -> bool:
    """Return True if an estimate is trustworthy and claims a smaller uncertainty than the other."""
    own, others = (np.inf if of.uncertainty is None else of.uncertainty.rms_mps2 for of in (evidence, other))
    return is_trustworthy(evidence) and own < others


def _of_a_part(whole: Evidence) -> tuple[Evidence, Mapping[str, str]] | None:
    """Return the estimate of a part, from rest to rest, that is good by itself; None where there is none, or no need.

    After a change of the sensor, only the later part describes the sensor as it is now, so it is the one to use. Where
    it is not good, the whole stays: its uncertainty covers the sensor before and after. Where the whole has no fit, as
    after an axis froze, the earlier part is used if the later one is not good. Where a sensor only reached the end of
    its range, the part before is used, without a reservation; if the whole is refused, that part may be usable only.
    """
    recording, flat, of_whole = whole.recording, whole.flat, find_reasons(whole)
    changed = next((reason for reason in of_whole if reason.span is not None), None)
    refused = any(reason.refuse for reason in of_whole)
    clipped = np.flatnonzero(recording.acc_clipped | recording.gyr_clipped)
    if flat is None or (changed is None and not len(clipped)):
        return None
    t, (starts, ends) = recording.t - recording.t[0], whole.rests.T
    span = None if changed is None else changed.span
    first, last = (clipped[0], len(t)) if span is None else np.searchsorted(t, span)
    before = "before", "what follows", 0, int(ends[ends <= first].max(initial=0))
    after = "after", "what precedes", int(starts[starts >= last].min(initial=len(t))), len(t)
    parts = [before] if changed is None else [after] if whole.fit is not None else [after, before]
    for when, left_out, begin, end in parts:
        if end - begin <= flat.n:
            continue
        seconds = t[end - 1] if when == "before" else t[begin]
        part, chosen = _with_gyroscope(replace(whole.part(begin, end), model="auto"))
        reasons = find_reasons(part)
        is_unclipped = len(clipped) and end <= clipped[0]
        if part.fit is None or any(each.refuse or not (refused and is_unclipped) for each in reasons):
            continue
        if changed is not None:
            what = changed.what + OF_A_PART.format(when=when, seconds=seconds)
            part = replace(part, changed=replace(changed, what=what, refuse=False))
        return part, {**chosen, "why": f"{chosen['why']}; {left_out} {seconds:.1f} s is left out"}
    return None


def _of_rests(before: Evidence, at_fault: Reason) -> Evidence:
    """Return the estimate from the rests alone; without a fit where the recording does not begin with a rest.

    The rests are found without the rates, too: a faulty gyroscope's, or another board's, do not show them.
    """
    recording = replace(before.recording, gyr=np.full_like(before.recording.gyr, np.nan))
    segment = recording.flat or find_flat(recording)
    usable = replace(at_fault, what=at_fault.what + OF_RESTS, refuse=False)
    flat = flat_statistics(recording, segment) if segment is not None and is_long_enough(recording, segment) else None
    evidence = replace(before, model="static", gyro_fault=usable, flat=flat)
    if flat is None or is_unusable(evidence):
        return evidence
    return replace(evidence, fit=fit_static(recording, flat, before.gravity))


def _with_gyroscope(before: Evidence) -> tuple[Evidence, Mapping[str, str]]:
    """Return the estimate by the requested model, and the model's name with why; what follows a reset is left out.

    Its covariance includes what the explanations say, and the changes of the gyroscope's bias that were removed.
    """
    recording, gravity, model = before.recording, before.gravity, before.model
    segment = recording.flat or find_flat(recording)
    flat = flat_statistics(recording, segment) if segment is not None and is_long_enough(recording, segment) else None
    end = None if flat is None else find_reset(recording, flat)
    if end is not None:
        before = before.part(0, end)
        recording = before.recording
    before = replace(before, flat=flat)
    if flat is None or is_unusable(before):
        return before, NOTHING | {"model": model}
    fitted = _Fitted(recording, (flat, gravity, model))
    sensitivity = fitted.find_sensitivity()
    if sensitivity is not None and sensitivity.S.any():
        fitted = _Fitted(sensitivity.removed_from(recording, flat), (flat, gravity, model))
    fitted = without_changes(fitted)
    choice, plain = fitted.choice, fitted.choice.plain
    fit = choice.honest() if sensitivity is None else sensitivity.held_by(choice.honest())
    explanations = explain(plain.parts, plain.D, fitted.explanations)
    claim = claim_uncertainty(fit, gravity, explanations, fitted.left_by_changes())
    fit = inflate(fit, claim).right_handed()
    evidence = replace(before, fit=fit, model=choice.model, claim=claim, gyro_changes=fitted.changes)
    left_out = f"; the board was back at once at {recording.t[-1]:.1f} s, and what follows is left out"
    return evidence, {"model": choice.model, "why": choice.why + (left_out if end is not None else "")}


class _Fitted:
    """Fit by the requested model, with the explanations of its residuals, the likeliest first.

    of : flat segment, gravity and model, with which each recording is fitted. changes : removed from the recording.
    """

    def __init__(
        self,
        recording: Recording,
        of: tuple[Flat, float, str],
        changes: tuple[Explanation, ...] = (),
        choice: ModelChoice | None = None,
    ) -> None:
        self._recording, self._of, self._changes = recording, of, changes
        self.choice = choice or fit_model(recording, *of)
        self.explanations = rank(self.choice.plain.parts, self.choice.plain.D)

    @property
    def changes(self) -> tuple[Explanation, ...]:
        """Changes of the gyroscope's bias that were removed for the fit; a hand's fit removes some itself."""
        found = self.choice.found
        return self._changes + (found.changes if isinstance(found, HandFit) else ())

    def left_by_changes(self) -> Vector | float:
        """Return the covariance (p, p) of the estimate by the error that is left of the removed changes."""
        plain, found = self.choice.plain, self.choice.found
        if plain.parts is None:
            return 0.0
        rests_often = isinstance(found, HandFit) and found.fine.rests_often
        return unseen_changes(self.changes, plain.parts, plain.D, rests_often)

    def find_sensitivity(self) -> Sensitivity | None:
        """Return the gyroscope's sensitivity to acceleration, where no rests show it; None if none, or by a hand."""
        found, (flat, gravity, _) = self.choice.found, self._of
        if isinstance(found, HandFit) and found.noise.kind != "none":
            return None
        return find_sensitivity(self._recording, flat, gravity, self.choice.plain, self.explanations)

    def cost(self) -> float:
        """Return the cost function (8) where the search ended."""
        return self.choice.plain.V

    def find_change(self) -> Explanation | None:
        """Return the change of the gyroscope's bias that explains the residuals; None if none does, or no fit ended."""
        return gyroscope_change(self.explanations) if self.choice.plain.converged else None

    def without(self, change: Explanation) -> _Fitted:
        """Remove one more change from the recording, and fit it again."""
        found = self.choice.found
        if isinstance(found, HandFit):
            choice = self.choice._replace(found=found.without(change))
            return _Fitted(self._recording, self._of, self._changes, choice)
        recording = remove_change(self._recording, self._of[0], change)
        return _Fitted(recording, self._of, (*self._changes, change))
