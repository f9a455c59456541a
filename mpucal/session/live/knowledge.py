"""Uncertainties of a live fit as an event: in %, deg and mg, and as progress towards the target."""

from __future__ import annotations

import numpy as np

from ...calibration.interim import InterimEstimate
from ...data import Vector
from ...result import error_model
from ..events import Knowledge, Target, triple


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
    """Return why no good sensor would give these numbers; empty where one might, or while D is not known well."""
    if known.D_std.max() > 0.02:
        return ""
    gains = np.diag(error_model.sensor_axes(D))
    if np.trace(D) < 1.5 * gains.mean():
        return "the accelerometer's axes do not match the gyroscope's: one is flipped or swapped"
    if (np.abs(np.log2(gains)) > 0.8).all():
        return f"the accelerometer reads {gains.mean():.2g} times gravity: is its range right?"
    return ""
