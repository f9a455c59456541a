"""Calibration of a recording: `calibrate`, the one function that everything else calls."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..data import RUN, STANDARD_GRAVITY_MPS2, Recording, Vector
from ..result import keys
from ..result.calibration import Calibration, unknown
from ..result.clock import iso_utc
from ..result.correlation import correlation_of, standard_deviations
from .common_motion import beside_first
from .estimation import MODELS, estimate
from .evidence import Evidence
from .fit import Fit
from .parameters import B_A_NAMES, B_OMEGA_NAMES, BY_NAME, D_NAMES
from .quality import judge
from .theta import from_elements

__all__ = ["MODELS", "calibrate", "calibrate_all", "estimate", "recording_digest"]

# Step of a digest [m/s^2, rad/s], far below a count of any sensor and far above what a text file rounds away, and the
# largest value that it distinguishes, which no sensor measures.
DIGEST_STEP, DIGEST_MOST = 1e-6, 1e12


def calibrate(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> Calibration:
    """Estimate the accelerometer's D and b_a: y = D R(x) g + b_a + e (the paper's equation 3).

    A bad recording gives a calibration whose verdict is "refused", with reasons; nothing is raised for it.

    Parameters
    ----------
    recording : what was measured, first lying flat, then turned.
    model : one of MODELS. gravity : m/s^2, the local ||g||.
    gravity_anyway : confirm a gravity outside the range found on Earth, which is else a reason against the calibration.

    Raises
    ------
    WrongValue : the model does not exist, or the gravity is impossible.
    """
    return _calibration(*estimate(recording, model, gravity, gravity_anyway))


def calibrate_all(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> list[Calibration]:
    """Calibrate all accelerometers of a board: the first like `calibrate`, and the recording's `others` beside it.

    Raises
    ------
    WrongValue : see calibrate.
    """
    first, *others = [estimate(each, model, gravity, gravity_anyway) for each in (recording, *recording.others)]
    return [_calibration(*first), *(_calibration(beside_first(first[0], other), chosen) for other, chosen in others)]


def recording_digest(recording: Recording) -> str:
    """Return the SHA-256 of acc and gyr, 64 hexadecimal digits, by which a recording is known from any file format.

    Times are left out, since another reading of a clock changes them.
    """
    digest = hashlib.sha256()
    for values in (recording.acc, recording.gyr):
        for first in range(0, len(values), RUN):
            part = values[first : first + RUN]
            # A gyroscope that was not measured is NaN.
            measured = np.clip(np.where(np.isnan(part), 0.0, part), -DIGEST_MOST, DIGEST_MOST)
            digest.update(np.rint(measured / DIGEST_STEP).astype("<i8").tobytes())
    return digest.hexdigest()


def _calibration(evidence: Evidence, chosen: Mapping[str, str]) -> Calibration:
    recording, flat, fit = evidence.recording, evidence.flat, evidence.fit
    gyroscope_known = evidence.gyro_fault is None  # one at fault shows neither bias nor noise
    common: dict[str, Any] = {
        "fit": _fit_document(evidence, chosen),
        "quality": judge(evidence),
        "sensor": recording.sensor,
        "created": iso_utc(),
        "noise_std": unknown(3) if flat is None else np.sqrt(flat.Sigma_a),
        "gyro_noise_std": np.sqrt(flat.Sigma_omega) if flat is not None and gyroscope_known else unknown(3),
    }
    if fit is None:
        return Calibration(D=unknown(3, 3), b_a=unknown(3), **common)
    calibration = Calibration(
        D=fit.D,
        b_a=fit.b_a,
        D_std=_stds(fit, D_NAMES).reshape(3, 3),
        b_a_std=_stds(fit, B_A_NAMES),
        K=fit.K,
        K_std=np.hypot(
            from_elements(BY_NAME["K"].form, _stds(fit, BY_NAME["K"].names)),
            # A clock that runs fast makes every rate smaller.
            (recording.sensor.clock_std or 0.0) * np.abs(fit.K),
        ),
        b_omega=fit.b_omega if gyroscope_known else unknown(3),
        b_omega_std=fit.std(*B_OMEGA_NAMES),
        **common,
    ).drop_unserialisable()
    std = standard_deviations(vars(calibration))
    return replace(calibration, correlation=correlation_of(fit.names, fit.covariance, std))


def _fit_document(evidence: Evidence, chosen: Mapping[str, str]) -> keys.Fit:
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


def _stds(fit: Fit, names: Sequence[str]) -> Vector:
    """Return standard deviations, NaN for parameters that the data hardly determine."""
    return np.where([name in fit.at_prior for name in names], np.nan, fit.std(*names))
