"""What is known, in the units that people use. Knows no estimator."""

from __future__ import annotations

import numpy as np

from ...calibration.knowledge import Known
from ...data import STANDARD_GRAVITY_MPS2, Vector
from ..events import Direction, Knowledge, Target


def wanted(target: Target) -> Vector:
    """(12,) the target's standard deviations, of D row-major and b_a [m/s^2]."""
    D = np.full((3, 3), np.deg2rad(target.misalignment_deg))
    np.fill_diagonal(D, target.gain_pct / 100.0)
    return np.concatenate([D.ravel(), np.full(3, target.bias_mg / 1000.0 * STANDARD_GRAVITY_MPS2)])


def knowledge(known: Known, target: Target, t_s: float, down: Vector | None) -> Knowledge:
    """The same in %, deg and mg, and how far that is from the target.

    Parameters
    ----------
    down : (3,) the orientation that would help most, if that was asked.
    """
    D = known.theta.D
    gains = np.abs(np.diag(D))
    gain = 100.0 * np.diag(known.D_std)
    lean = np.degrees(known.D_std / np.maximum(gains, 0.1)[:, None])
    np.fill_diagonal(lean, 0.0)
    misalignment = lean.max(1)
    bias = 1000.0 * known.b_a_std / STANDARD_GRAVITY_MPS2
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
    return f"gains to {gain.max():.2g} %, axes to {misalignment.max():.2g} deg, bias to {bias.max():.2g} mg"


def _doubt(D: Vector, known: Known) -> str:
    """What the numbers say already that no good sensor's would."""
    if known.D_std.max() > 0.02:
        return ""
    gains = np.linalg.norm(D, axis=0)
    if np.trace(D) < 1.5 * gains.mean():
        return "the accelerometer's axes do not match the gyroscope's: one is flipped or swapped"
    if (np.abs(np.log2(gains)) > 0.8).all():
        return f"the accelerometer reads {gains.mean():.2g} times gravity: is its range right?"
    return ""


def _three(v: Vector) -> Direction:
    x, y, z = np.asarray(v, float).tolist()
    return (x, y, z)
