"""The verdict: what speaks against an estimate, in sentences with a remedy, each with a stable code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from ..data import Mask, Recording, Vector
from ..result import GOOD, REFUSED, USABLE
from .information import Uncertainty, uncertainty
from .model import Fit, Flat

GOOD_RMS_MPS2, USABLE_RMS_MPS2 = 0.1, 0.5
CONSISTENT_NIS = 5.0
LEAST_TURN_DEG = 20.0
FASTEST_GYRO_RAD_S = np.deg2rad(4100.0)
WORST_AXES_DEG = 60.0


@dataclass(frozen=True)
class Reason:
    """One thing that speaks against the estimate; `refuse` where nobody should use it."""

    code: str
    message: str
    refuse: bool


@dataclass(frozen=True)
class Evidence:
    """All that a verdict rests on; fit, flat and sure are None where the recording did not get so far."""

    recording: Recording
    gravity: float
    flat: Flat | None = None
    fit: Fit | None = None
    sure: Uncertainty | None = None


def judge(recording: Recording, flat: Flat | None, fit: Fit | None, gravity: float) -> Mapping[str, Any]:
    """The `quality` of calibration.json: verdict, reasons, and the magnitude of acceleration before and after."""
    sure = None
    if fit is not None and np.isfinite(fit.covariance).all() and abs(np.linalg.det(fit.D)) > 1e-6:
        sure = uncertainty(fit.D, fit.covariance[:12, :12], gravity)
    evidence = Evidence(recording, gravity, flat, fit, sure)
    reasons = [reason for check in _CHECKS if (reason := check(evidence)) is not None]
    verdict = REFUSED if any(r.refuse for r in reasons) else USABLE if reasons else GOOD
    return MappingProxyType(
        {
            "verdict": verdict,
            "reasons": [{"code": r.code, "message": r.message} for r in reasons],
            "magnitude_before": _magnitude(recording.acc),
            "magnitude_after": _magnitude(_calibrated(recording, fit)) if sure is not None else _magnitude(None),
            "error_std": {
                "rms": np.nan if sure is None else sure.rms_mps2,
                "magnitude": np.nan if sure is None else sure.magnitude_mps2,
                "direction_deg": np.nan if sure is None else np.rad2deg(sure.direction_rad),
            },
        }
    )


def _calibrated(recording: Recording, fit: Fit | None) -> Vector | None:
    return None if fit is None else np.asarray((recording.acc - fit.b_a) @ np.linalg.inv(fit.D).T)


def _magnitude(acc: Vector | None) -> dict[str, float]:
    if acc is None:
        return {"median": np.nan, "mean": np.nan, "std": np.nan}
    a = np.linalg.norm(acc, axis=1)
    return {"median": float(np.median(a)), "mean": float(a.mean()), "std": float(a.std())}


def _units_suspect(e: Evidence) -> Reason | None:
    acc = float(np.median(np.linalg.norm(e.recording.acc, axis=1)))
    if not 0.2 * e.gravity < acc < 5.0 * e.gravity:
        guess = "g" if acc < 5.0 else "mg" if 200.0 < acc < 5000.0 else "raw counts"
        return Reason(
            "units_suspect",
            f"the accelerometer's median magnitude is {acc:.4g}, not near {e.gravity:.4g} m/s^2: it seems to be in "
            f"{guess}; convert it to m/s^2",
            True,
        )
    rate = float(np.abs(e.recording.gyr).max())
    turned = e.flat is not None and float(_turned(e.recording, e.flat, 1.0)) > 20.0 * _seen_turn(e.recording)
    if rate > FASTEST_GYRO_RAD_S or (turned and rate > np.deg2rad(600.0)):
        return Reason(
            "units_suspect",
            f"the gyroscope reads up to {rate:.4g}, which as rad/s is {np.rad2deg(rate):.0f} deg/s: it seems to be in "
            "deg/s; convert it to rad/s",
            True,
        )
    return None


def _turned(recording: Recording, flat: Flat, scale: float) -> float:
    """rad that the gyroscope has turned in all, after the flat segment."""
    rate = np.linalg.norm(recording.gyr[flat.last :] - flat.b_omega, axis=1)
    return float(scale * np.sum(rate[1:] * np.diff(recording.t[flat.last :])))


def _seen_turn(recording: Recording) -> float:
    """rad that the accelerometer's direction has turned in all, in half-second means; at least a tenth."""
    n = max(round(0.5 * recording.rate_hz), 1)
    m = len(recording) // n
    means = recording.acc[: m * n].reshape(m, n, 3).mean(1)
    u = means / np.maximum(np.linalg.norm(means, axis=1, keepdims=True), 1e-9)
    angles = np.arccos(np.clip(np.sum(u[1:] * u[:-1], axis=1), -1, 1))
    return max(float(angles[angles > np.deg2rad(2.0)].sum()), 0.1)


def _never_still(e: Evidence) -> Reason | None:
    if e.flat is not None:
        return None
    return Reason(
        "never_still",
        "the board never lay still for a second, so the gyroscope's bias and the noise are not known; lay it on a "
        "table for ten seconds before you turn it",
        True,
    )


def _few_orientations(e: Evidence) -> Reason | None:
    if e.flat is None:
        return None
    seen = _directions_spread_deg(e.recording, e.flat)
    if seen < LEAST_TURN_DEG:
        return Reason(
            "few_orientations",
            f"the board was hardly turned (gravity moved {seen:.0f} deg in all); turn it so that each of its sides, "
            "edges and corners points down once",
            True,
        )
    if e.sure is None or e.sure.rms_mps2 <= GOOD_RMS_MPS2:
        return None
    axis = "xyz"[int(np.argmax(np.abs(e.sure.worst)))]
    return Reason(
        "few_orientations",
        f"a calibrated direction is known to {e.sure.rms_mps2:.2g} m/s^2 only, worst with {axis} vertical; turn it "
        f"through more orientations, with {axis} up, down and aslant",
        e.sure.rms_mps2 > USABLE_RMS_MPS2,
    )


def _directions_spread_deg(recording: Recording, flat: Flat) -> float:
    """The largest angle between the flat mean and a half-second mean that followed."""
    n = max(round(0.5 * recording.rate_hz), 1)
    acc = recording.acc[flat.last :]
    m = len(acc) // n
    if m == 0:
        return 0.0
    means = acc[: m * n].reshape(m, n, 3).mean(1)
    u = means / np.maximum(np.linalg.norm(means, axis=1, keepdims=True), 1e-9)
    return float(np.rad2deg(np.arccos(np.clip((u @ (flat.y / np.linalg.norm(flat.y))).min(), -1, 1))))


def _clipped(
    code: str, sensor: str, remedy: str, mask: Callable[[Recording], Mask]
) -> Callable[[Evidence], Reason | None]:
    def check(e: Evidence) -> Reason | None:
        count = int(mask(e.recording).sum())
        if count == 0:
            return None
        share = count / len(e.recording)
        return Reason(
            code, f"the {sensor} stood at the end of its range in {count} samples ({share:.1%}); {remedy}", share > 0.2
        )

    return check


def _data_lost(e: Evidence) -> Reason | None:
    gaps = e.recording.gap
    if not gaps.any():
        return None
    lost = float(np.diff(e.recording.t, prepend=e.recording.t[0])[gaps].sum())
    return Reason(
        "data_lost",
        f"samples are missing in {int(gaps.sum())} places ({lost:.2f} s in all); use a faster bus or a lower rate",
        lost > 0.5 * (e.recording.t[-1] - e.recording.t[0]),
    )


def _wrong_range(e: Evidence) -> Reason | None:
    if e.fit is None:
        return None
    gains = np.linalg.norm(e.fit.D, axis=0)
    power = np.round(np.log2(gains)).astype(int)
    if power[0] == 0 or not (power == power[0]).all() or not (np.abs(gains / 2.0 ** power[0] - 1.0) < 0.05).all():
        return None
    return Reason(
        "wrong_range",
        f"all three gains are near {2.0 ** power[0]:g}: the accelerometer's range is not the one assumed (or it is an "
        "early revision with half the sensitivity); give the true range",
        True,
    )


def _axes(e: Evidence) -> Reason | None:
    """The rotation nearest to D is small for a sensor whose axes are named as the gyroscope's."""
    if e.fit is None or e.sure is None:
        return None
    angle, Q = _nearest_rotation_deg(e.fit.D)
    if angle <= WORST_AXES_DEG:
        return None
    # D is forced to be right-handed: a left-handed sensor shows as the mirror of its true D
    mirrored = -Q
    if np.trace(mirrored) >= 1.0 - 0.5:
        axis = "xyz"[int(np.argmin(np.diag(mirrored)))]
        return Reason(
            "left_handed",
            f"the accelerometer's axes are left-handed against the gyroscope's: change the sign of its {axis} axis "
            "(or of one gyroscope axis)",
            True,
        )
    order = ", ".join(("-" if row[k] < 0 else "") + "xyz"[k] for row in Q for k in [int(np.argmax(np.abs(row)))])
    return Reason(
        "swapped_axes",
        f"the accelerometer's axes x, y, z point along the gyroscope's {order}: swap them so that both agree",
        True,
    )


def _nearest_rotation_deg(D: Vector) -> tuple[float, Vector]:
    U, _, Vt = np.linalg.svd(D)
    Q = U @ Vt
    return float(np.rad2deg(np.arccos(np.clip((np.trace(Q) - 1.0) / 2.0, -1.0, 1.0)))), Q


def _not_converged(e: Evidence) -> Reason | None:
    if e.fit is None or e.fit.converged:
        return None
    return Reason(
        "not_converged",
        f"the estimate had not settled after {e.fit.iterations} iterations; record again, with slower turns and pauses",
        True,
    )


def _inconsistent(e: Evidence) -> Reason | None:
    if e.fit is None or e.fit.nis <= CONSISTENT_NIS:
        return None
    after = _calibrated(e.recording, e.fit)
    off = abs(_magnitude(after)["median"] - e.gravity) / e.gravity if after is not None else 1.0
    return Reason(
        "inconsistent",
        f"the model does not explain the data (normalised innovations {e.fit.nis:.0f}, expected 3): the hand's own "
        "acceleration or the gyroscope's scale; turn slowly, pause often, and rest the board when you pause",
        not off < 0.05,
    )


_CHECKS: tuple[Callable[[Evidence], Reason | None], ...] = (
    _units_suspect,
    _never_still,
    _few_orientations,
    _clipped(
        "gyro_clipped", "gyroscope", "turn more slowly, or choose a larger gyroscope range", lambda r: r.gyr_clipped
    ),
    _clipped(
        "accel_clipped",
        "accelerometer",
        "move more gently, or choose a larger accelerometer range",
        lambda r: r.acc_clipped,
    ),
    _data_lost,
    _wrong_range,
    _axes,
    _not_converged,
    _inconsistent,
)
