"""From a recording to a Calibration: the one function that everything else calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Recording
from ..errors import UsageError
from ..result import Calibration, unknown
from .estimate import fit_accel
from .masks import with_masks
from .model import B_A_NAMES, B_OMEGA_NAMES, D_NAMES, Fit, Flat
from .paper import fit_paper
from .quality import judge
from .stationary import find_flat, flat_statistics

__all__ = ["MODELS", "calibrate"]

_METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit]] = {"accel": fit_accel, "paper": fit_paper}
MODELS = ("auto", *_METHODS)

FEWEST_SAMPLES = 50


def calibrate(recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2) -> Calibration:
    """Estimate the accelerometer's D and b_a: y = D R(x) g + b_a + e (the paper's equation 3).

    A bad recording gives a calibration whose verdict is "refused", with reasons; nothing is raised for it.

    Parameters
    ----------
    recording : what was measured, first lying flat, then turned.
    model : one of MODELS. gravity : m/s^2, the local ||g||.

    Raises
    ------
    UsageError : no such model, or a gravity that is none.
    """
    if model not in MODELS:
        raise UsageError(f"there is no model {model!r}", f"choose one of {', '.join(MODELS)}")
    if not (np.isfinite(gravity) and gravity > 0):
        raise UsageError(f"gravity is {gravity}", "give the local gravity in m/s^2, about 9.81")
    recording = with_masks(recording)
    chosen, why = ("accel", "the estimator for a trusted gyroscope") if model == "auto" else (model, "asked for")
    segment = recording.flat or find_flat(recording)
    flat = None if segment is None or segment[1] - segment[0] < 2 else flat_statistics(recording, segment)
    fit = None
    if flat is not None and len(recording) - flat.last >= FEWEST_SAMPLES:
        fit = _METHODS[chosen](recording, flat, gravity)
    seconds = float(recording.t[-1] - recording.t[0])
    about = {"model": chosen, "why": why, "gravity": gravity, "samples": len(recording), "seconds": seconds}
    return _calibration(recording, flat, fit, about, judge(recording, flat, fit, gravity))


def _calibration(
    recording: Recording, flat: Flat | None, fit: Fit | None, about: Mapping[str, Any], quality: Mapping[str, Any]
) -> Calibration:
    common: dict[str, Any] = {
        "quality": quality,
        "sensor": recording.sensor,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "noise_std": unknown(3) if flat is None else np.sqrt(flat.Sigma_a),
        "gyro_noise_std": unknown(3) if flat is None else np.sqrt(flat.Sigma_omega),
    }
    if fit is None:
        nothing = {"parameters": 0, "iterations": 0, "converged": False, "nis": np.nan}
        return Calibration(D=unknown(3, 3), b_a=unknown(3), fit=MappingProxyType({**about, **nothing}), **common)
    numbers = {"parameters": len(fit.names), "iterations": fit.iterations, "converged": fit.converged, "nis": fit.nis}
    return Calibration(
        D=fit.D,
        b_a=fit.b_a,
        D_std=fit.std(*D_NAMES).reshape(3, 3),
        b_a_std=fit.std(*B_A_NAMES),
        K=fit.K,
        b_omega=fit.b_omega,
        b_omega_std=fit.std(*B_OMEGA_NAMES),
        fit=MappingProxyType({**about, **numbers}),
        **common,
    )
