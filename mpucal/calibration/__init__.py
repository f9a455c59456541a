"""From a recording to a Calibration: the one function that everything else calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from ..arguments import LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2
from ..data import STANDARD_GRAVITY_MPS2, Recording, Vector
from ..errors import WrongValue
from ..reasons import OF_RESTS, Reason
from ..rests.flat import Flat, find_flat, flat_statistics, tells
from ..result import keys
from ..result.calibration import Calibration, unknown
from ..result.correlation import correlation_of, standard_deviations
from .checks import found, gyroscope_at_fault, unusable_for_a_fit
from .checks.unusable import no_gyroscope
from .claim import claim_of, claimed
from .evidence import Evidence
from .fit import Fit
from .lone_jumps import without_lone_jumps
from .masks import reset, with_masks
from .model_selection import METHODS, Choice, choose
from .parameters import B_A_NAMES, B_OMEGA_NAMES, BY_NAME, D_NAMES
from .quality import judge
from .recording_digest import recording_digest
from .static import fit_static
from .theta import from_elements
from .walks import Walk, likeliest_walk, without_walk

__all__ = ["MODELS", "calibrate", "weigh"]

MODELS = ("auto", *METHODS)
NOTHING = {"why": "nothing could be estimated"}
# Each walk is what is left of a drift after the one before; it must make the recording as much likelier.
MOST_WALKS, LEAST_GAIN = 3, 10.0


def calibrate(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> Calibration:
    """Estimate the accelerometer's D and b_a: y = D R(x) g + b_a + e (the paper's equation 3).

    A bad recording gives a calibration whose verdict is "refused", with reasons; nothing is raised for it.

    Parameters
    ----------
    recording : what was measured, first lying flat, then turned.
    model : one of MODELS. gravity : m/s^2, the local ||g||.
    gravity_anyway : a gravity that no place on Earth has is meant, and no reason against the calibration.

    Raises
    ------
    WrongValue : no such model, or a gravity that is none.
    """
    return _calibration(*weigh(recording, model, gravity, gravity_anyway))


def weigh(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> tuple[Evidence, Mapping[str, str]]:
    """Estimate as `calibrate` does; return the evidence, with the fit and its covariance, and the model and why.

    Where the gyroscope is at fault and the rests suffice, the estimate is of the rests alone.

    Raises
    ------
    WrongValue : no such model, or a gravity that is none.
    """
    if model not in tuple(MODELS):  # which takes what has no hash
        raise WrongValue(f"there is no model {model!r}", f"choose one of {', '.join(MODELS)}")
    if not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise WrongValue(f"gravity is {gravity}", "give the local gravity in m/s^2, about 9.81")
    before = Evidence(recording, gravity, None, None, model, gravity_anyway=gravity_anyway)
    estimate = _with_gyroscope(before) if no_gyroscope(before) is None else (before, NOTHING | {"model": model})
    at_fault = gyroscope_at_fault(estimate[0]) if model == "auto" else None
    of_rests = None if at_fault is None else _of_rests(before, at_fault)
    return of_rests or estimate


def _of_rests(before: Evidence, at_fault: Reason) -> tuple[Evidence, Mapping[str, str]] | None:
    """The estimate from the rests alone; None where they do not suffice."""
    recording = with_masks(before.recording)
    segment = recording.flat or find_flat(recording)
    if segment is None or not tells(recording, segment):
        return None
    flat = flat_statistics(recording, segment)
    fit = fit_static(recording, flat, before.gravity)
    usable = replace(at_fault, what=at_fault.what + OF_RESTS, refuse=False)
    evidence = replace(before, recording=recording, flat=flat, fit=fit, model="static", gyroscope=usable)
    if any(reason.refuse for reason in found(evidence)):
        return None
    return evidence, {"model": "static", "why": "the gyroscope is at fault, and the rests are enough without it"}


def _with_gyroscope(before: Evidence) -> tuple[Evidence, Mapping[str, str]]:
    recording, gravity, model = before.recording, before.gravity, before.model
    # an acceleration that jumps alone may be a knock, which the fit weighs itself
    recording = replace(with_masks(recording), gyr=without_lone_jumps(recording).gyr)
    segment = recording.flat or find_flat(recording)
    flat = flat_statistics(recording, segment) if segment is not None and tells(recording, segment) else None
    over = None if flat is None else reset(recording, flat)
    if over is not None:
        recording = recording.part(0, over)
    before = replace(before, recording=recording, flat=flat)
    if flat is None or unusable_for_a_fit(before):
        return before, NOTHING | {"model": model}
    choice, walk = _fit(recording, flat, gravity, model)
    claim = claim_of(choice.fit, gravity, walk, choice.walked)
    evidence = replace(before, fit=claimed(choice.fit, claim).right_handed(), model=choice.model, claim=claim)
    left_out = f"; the board was back at once at {recording.t[-1]:.1f} s, and what follows is left out"
    return evidence, {"model": choice.model, "why": choice.why + (left_out if over is not None else "")}


def _fit(recording: Recording, flat: Flat, gravity: float, model: str) -> tuple[Choice, Walk | None]:
    """The fit, with a gyroscope's bias that walked while the board was turned taken away, and the walk that is left."""
    choice, walk = _fit_once(recording, flat, gravity, model)
    for _ in range(MOST_WALKS):
        if walk is None or walk.what != "gyroscope" or not choice.fit.converged:
            break
        without, left = _fit_once(without_walk(choice.recording, flat, walk), flat, gravity, model)
        if not without.fit.V < choice.fit.V - LEAST_GAIN:
            break
        choice, walk = without._replace(walked=without.walked + choice.walked + walk.q), left
    return choice, walk


def _fit_once(recording: Recording, flat: Flat, gravity: float, model: str) -> tuple[Choice, Walk | None]:
    if model == "auto":
        choice = choose(recording, flat, gravity)
    else:
        choice = Choice(METHODS[model](recording, flat, gravity), model, "asked for", recording)
    fit = choice.fit
    return choice, None if fit.parts is None else likeliest_walk(fit.parts, fit.D)


def _calibration(evidence: Evidence, chosen: Mapping[str, str]) -> Calibration:
    recording, flat, fit = evidence.recording, evidence.flat, evidence.fit
    common: dict[str, Any] = {
        "fit": _about(evidence, chosen),
        "quality": judge(evidence),
        "sensor": recording.sensor,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "noise_std": unknown(3) if flat is None else np.sqrt(flat.Sigma_a),
        "gyro_noise_std": unknown(3) if flat is None else np.sqrt(flat.Sigma_omega),
    }
    if fit is None:
        return Calibration(D=unknown(3, 3), b_a=unknown(3), **common)
    calibration = Calibration(
        D=fit.D,
        b_a=fit.b_a,
        D_std=_claimed(fit, D_NAMES).reshape(3, 3),
        b_a_std=_claimed(fit, B_A_NAMES),
        K=fit.K,
        K_std=np.hypot(
            from_elements(BY_NAME["K"].form, _claimed(fit, BY_NAME["K"].names)),
            # a clock that runs fast makes every rate smaller
            (recording.sensor.clock_std or 0.0) * np.abs(fit.K),
        ),
        b_omega=fit.b_omega,
        b_omega_std=fit.std(*B_OMEGA_NAMES),
        **common,
    ).drop_unserialisable()
    std = standard_deviations(vars(calibration))
    return replace(calibration, correlation=correlation_of(fit.names, fit.covariance, std))


def _about(evidence: Evidence, chosen: Mapping[str, str]) -> keys.Fit:
    recording, fit = evidence.recording, evidence.fit
    about: keys.Fit = {
        "model": chosen["model"],
        "why": chosen["why"],
        "gravity": evidence.gravity,
        "samples": len(recording),
        "recording_digest": recording_digest(recording),
        "seconds": float(recording.t[-1] - recording.t[0]),
        "parameters": 0 if fit is None else len(fit.names),
        "iterations": 0 if fit is None else fit.iterations,
        "converged": fit is not None and fit.converged,
        "nis": np.nan if fit is None else fit.nis,
    }
    if fit is not None:
        about = {**about, "at_prior": list(fit.at_prior)}
    return {**about, "gravity_anyway": True} if evidence.gravity_anyway else about


def _claimed(fit: Fit, names: Sequence[str]) -> Vector:
    """Standard deviations; unknown of what the data say little."""
    return np.where([name in fit.at_prior for name in names], np.nan, fit.std(*names))
