"""Errors of a calibration, or of a vehicle's parameters, against the truth: in m/s^2, and in units of the claim."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Vector
from mpucal.mavlink.parameters.slots import Correction, Slot
from mpucal.rests.flat import Flat
from mpucal.result.calibration import GOOD, USABLE, Calibration
from mpucal.result.error_model import sensor_axes
from mpucal.simulated.sensor import SensorTruth

from .table import Row

# a verdict is false if the error exceeds the claim by this factor, or that of an element exceeds its standard
# uncertainty by MOST_Z
MOST_CLAIMS: Mapping[str, float] = {GOOD: 3.0, USABLE: 5.0}
MOST_Z = 5.0


def judgement(
    verdict: str = "",
    reasons: tuple[str, ...] = (),
    error: float = math.nan,
    claim: float = math.nan,
    z: tuple[float, ...] = (),
    **more: Any,
) -> Row:
    """Return a row with a verdict and its errors, and `more`.

    error : of a calibrated reading, rms over all directions of gravity [m/s^2]. claim : its stated value [m/s^2].
    z : (12,) errors of D row-major and of b_a in units of their standard uncertainties; 0 between the truths of a
        sensor that changed, NaN where no uncertainty is claimed.

    Of these: `claims`, the error in units of the claim, infinite if it may be used but states no uncertainty;
    `farthest`, the largest |z|, 0 where none is known; `rms_z`, 1 if the uncertainties are true; and `false`, true if
    it is farther from the truth than a calibration of its verdict may be.
    """
    most = MOST_CLAIMS.get(verdict)
    claims = error / claim if claim > 0.0 else math.nan if most is None else math.inf
    farthest = max((abs(each) for each in z if not math.isnan(each)), default=0.0)
    return Row(
        **{"verdict": verdict, "reasons": reasons, "error": error, "claim": claim, "z": z},
        **{"claims": claims, "farthest": farthest, "rms_z": rms(z)},
        **{"false": most is not None and not (claims <= most and farthest <= MOST_Z), **more},
    )


def judged(calibration: Calibration, *truths: tuple[Vector, Vector], gravity: float | None = None, **more: Any) -> Row:
    """Compare a calibration with the truths (D, b_a) of its sensor, several where it changed.

    One of the rests alone is in the sensor's own axes, and so are the truths then.

    gravity : the one that scales D [m/s^2]; None: the one that the calibration was given.
    """
    gravity = gravity or float(calibration.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
    if calibration.fit.get("model") == "static":
        truths = tuple((sensor_axes(D), b_a) for D, b_a in truths)
    true = np.array([np.append(D, b_a) for D, b_a in truths])
    found = np.append(calibration.D, calibration.b_a)
    std = np.append(calibration.D_std, calibration.b_a_std)
    # a refused one may claim no uncertainty
    z = (found - np.clip(found, true.min(axis=0), true.max(axis=0))) / np.where(std > 0.0, std, np.nan)
    stated: Mapping[str, Any] = calibration.quality.get("error_std") or {}
    claim = stated.get("rms")
    return judgement(
        calibration.verdict,
        tuple(reason["code"] for reason in calibration.quality["reasons"]),
        min(sphere_rms(calibration, truth, gravity) for truth in truths),
        math.nan if claim is None else float(claim),
        tuple(z.tolist()),
        **more,
    )


def sphere_rms(calibration: Calibration, truth: tuple[Vector, Vector], gravity: float) -> float:
    """Return the error of a calibrated reading against (D, b_a), rms over all directions of gravity [m/s^2]."""
    D, b_a = (np.array(one, np.float64) for one in truth)
    return sph_rms(SensorTruth(D, b_a, np.eye(3), np.zeros(3), gravity), calibration.D, calibration.b_a)


def rms(values: Sequence[float]) -> float:
    """Return the root mean square of the known values; NaN if there is none."""
    known = [value for value in values if not math.isnan(value)]
    return math.sqrt(sum(value * value for value in known) / len(known)) if known else math.nan


def sph_rms(truth: SensorTruth, D: Vector, b_a: Vector) -> float:
    """Return the error of a calibrated noise-free vector [m/s^2], rms over all directions of gravity.

    The vector is inv(D) (D_true s + b_true - b_a) = s + A s + c, and the mean of |A s + c|^2 over the sphere |s| = g is
    g^2 / 3 |A|_F^2 + |c|^2.
    """
    A = np.linalg.solve(D, truth.D) - np.eye(3)
    c = np.linalg.solve(D, truth.b_a - b_a)
    return float(np.sqrt(truth.gravity**2 / 3.0 * np.sum(A * A) + c @ c))


def roll_pitch(s: Vector) -> tuple[Vector, Vector]:
    """Return roll and pitch [rad] of specific forces (n, 3) in the body: both (n,)."""
    return np.arctan2(s[:, 1], s[:, 2]), np.arctan2(-s[:, 0], np.hypot(s[:, 1], s[:, 2]))


def tilt_errors_deg(s_true: Vector, s: Vector) -> tuple[float, float]:
    """Return mean absolute errors of roll and pitch [deg] of specific forces s (n, 3) against the true ones (n, 3).

    Roll is compared where the cosine of the true pitch is above 0.2: below, near ±90 deg, a small tilt turns it by any
    angle.
    """
    (roll_true, pitch_true), (roll, pitch) = roll_pitch(s_true), roll_pitch(s)
    seen = np.cos(pitch_true) > 0.2
    d_roll = np.abs(np.remainder(roll - roll_true + np.pi, 2.0 * np.pi) - np.pi)[seen]
    return float(np.degrees(d_roll.mean())), float(np.degrees(np.abs(pitch - pitch_true).mean()))


def followed(recording: Recording, flat: Flat, D: Vector, b_a: Vector, gravity: float) -> Vector:
    """Return gravity (n, k, 3) [m/s^2] after the flat segment by the paper's EKF with D (k, 3, 3) and b_a (k, 3)."""
    x = np.concatenate([block.x for block in Ekf.after(flat, recording, gravity).run(D, b_a)])
    return specific_force(x, gravity)


def tilts_deg(s_true: Vector, s: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return k errors of roll and of pitch [deg], as `tilt_errors_deg`, of s (n, k, 3) where s_true is known."""
    known = np.isfinite(s_true).all(1)
    roll, pitch = zip(*(tilt_errors_deg(s_true[known], s[known, k]) for k in range(s.shape[1])), strict=True)
    return roll, pitch


def needed(truth: SensorTruth) -> Correction:
    """Return the parameters that a vehicle's sensor needs."""
    return Correction(truth.b_a, np.diag(np.linalg.inv(truth.D)))


def off(where: Slot | None, parameters: Mapping[str, float], true: Correction) -> tuple[float, float]:
    """Return how far an IMU's parameters are from what it needs, at worst over its axes: offset [m/s^2] and scale.

    Infinity where it has none.
    """
    held = None if where is None else where.correction(parameters)
    if held is None:
        return np.inf, np.inf
    return float(np.abs(held.offset - true.offset).max()), float(np.abs(held.scale - true.scale).max())


def z_of(document: Mapping[str, Any], truth: Mapping[str, Any]) -> tuple[float, ...]:
    """Return (12,) of D and b_a of an IMU's document: (estimate - truth) / standard uncertainty."""
    z: tuple[float, ...] = judged(Calibration.from_document(document), (np.array(truth["D"]), np.array(truth["b_a"]))).z
    return z
