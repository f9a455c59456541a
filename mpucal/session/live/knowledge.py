"""The uncertainties of a live fit as an event: in %, deg and mg, and as progress toward the target."""

from __future__ import annotations

import numpy as np

from ...calibration.interim import InterimEstimate
from ...data import Vector
from ...result import error_model
from ..events import Direction, Knowledge, Target


def wanted(target: Target) -> Vector:
    """(12,) the target's standard deviations, of D row-major and b_a [m/s^2]."""
    D = np.full((3, 3), np.deg2rad(target.misalignment_deg))
    np.fill_diagonal(D, target.gain_pct / 100.0)
    return np.concatenate([D.ravel(), np.full(3, target.bias_mg / error_model.MG_PER_MPS2)])


def knowledge(known: InterimEstimate, target: Target, t_s: float, down: Vector | None) -> Knowledge:
    """The same in %, deg and mg, and how far that is from the target.

    Parameters
    ----------
    down : (3,) the orientation that would help most, if that was asked.
    """
    D = known.theta.D
    gain = error_model.scale_factor_error_std(known.D_std)
    misalignment = np.nanmax(error_model.misalignment_std(D, known.D_std), axis=1)
    bias = error_model.bias_mg(known.b_a_std)
    wishes = ((target.gain_pct, gain), (target.misalignment_deg, misalignment), (target.bias_mg, bias))
    progress = [np.clip(wish / np.maximum(std, 1e-9), 0.0, 1.0) for wish, std in wishes]
    return Knowledge(
        t_s,
        _three(gain),
        _three(misalignment),
        _three(bias),
        target,
        _three(progress[0]),
        _three(progress[1]),
        _three(progress[2]),
        overall=float(np.min(progress)),
        down=None if down is None else _three(down),
        words=_words(gain, misalignment, bias),
        doubt=_doubt(D, known),
    )


def _words(gain: Vector, misalignment: Vector, bias: Vector) -> str:
    return (
        f"scale factor error {gain.max():.2g} %, misalignment {misalignment.max():.2g} deg, bias {bias.max():.2g} mg"
        " (1 sigma)"
    )


def _doubt(D: Vector, known: InterimEstimate) -> str:
    """What the numbers say already that no good sensor's would."""
    if known.D_std.max() > 0.02:
        return ""
    gains = np.diag(error_model.sensor_axes(D))
    if np.trace(D) < 1.5 * gains.mean():
        return "the accelerometer's axes do not match the gyroscope's: one is flipped or swapped"
    if (np.abs(np.log2(gains)) > 0.8).all():
        return f"the accelerometer reads {gains.mean():.2g} times gravity: is its range right?"
    return ""


def _three(v: Vector) -> Direction:
    x, y, z = np.asarray(v, float).tolist()
    return (x, y, z)
