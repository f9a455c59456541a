"""What can speak against an estimate: one check a reason code, in sentences with a remedy. Knows no estimator."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations
from itertools import product as choices

import numpy as np

from ..data import Mask, Recording
from ..result.error_model import sensor_axes
from .blockers import Check, Reason
from .evidence import Evidence, Rests
from .tilt import CONE_RAD

GOOD_RMS_MPS2, USABLE_RMS_MPS2 = 0.1, 0.4
CONSISTENT_NIS = 5.0
WORST_AXES_RAD = np.deg2rad(60.0)
GYRO_SCALE_OFF, GYRO_CROSS_OFF = 0.06, 0.04
MOST_GAIN = 2.5  # one way or the other; the paper simulates sensors of 0.5 to 1.5
WARMER_C = 5.0
RESTS_MPS2, RESTS_RAD = 0.08, np.deg2rad(1.5)
HONEST_FACTOR = 5.0
MOST_CLIPPED = 0.2
# Of a change's significance. Hands whose pivot wobbles reach 4.5 without one. A gyroscope's non-linearity, which rests
# show most, makes it 10 with a real sensor.
STEADY, STEADY_BY_RESTS = 5.0, 12.0
UNSTEADY_BY_FAR = 4.0
# So well agree no rests of a sensor that changed.
AGREE_MPS2, AGREE_RAD = 0.015, np.deg2rad(0.1)


def moved_while_still(e: Evidence) -> Reason | None:
    """A flat segment, given by its caller, in which the board moved."""
    if e.flat is None or e.flat.n < 4:
        return None
    half = e.flat.n // 2
    acc = e.recording.acc[e.flat.first : e.flat.first + 2 * half].reshape(2, half, 3)
    moved = np.abs(acc[1].mean(0) - acc[0].mean(0))
    if (moved <= 0.1 + 6.0 * np.sqrt(2.0 * acc.var(1).min(0) / half)).all():
        return None
    axis = int(np.argmax(moved))
    return Reason(
        "moved_while_still",
        f"the board moved while it should have lain flat ({'xyz'[axis]} changed by {moved[axis]:.2g} m/s^2); lay it "
        "down, take the hands off, and wait for ten seconds",
        True,
    )


def few_orientations(e: Evidence) -> Reason | None:
    """A direction that the data leave open."""
    if e.fit is None or (e.sure is not None and e.sure.rms_mps2 <= GOOD_RMS_MPS2):
        return None
    if e.sure is None:
        return Reason(
            "few_orientations",
            "the recording says so little that no direction can be calibrated by it; does its accelerometer follow the "
            "board throughout? Rest it in ten orientations that differ",
            True,
        )
    worst, rms = e.sure.worst, e.sure.rms_mps2
    known = f"known to {rms:.2g} m/s^2 only" if rms < e.gravity else "not known at all"
    side = "".join(f" {'+' if w > 0 else '-'}{axis}" for axis, w in zip("xyz", worst, strict=True) if abs(w) > 0.4)
    return Reason(
        "few_orientations",
        f"a calibrated direction is {known}, worst with{side} up; rest it in more orientations, above all with{side} "
        "up, down and aslant",
        not rms <= USABLE_RMS_MPS2,
    )


def clipped(code: str, sensor: str, remedy: str, mask: Callable[[Recording], Mask]) -> Check:
    """Samples at the end of the range."""

    def check(e: Evidence) -> Reason | None:
        count = int(mask(e.recording).sum())
        if count == 0:
            return None
        share = count / len(e.recording)
        sentence = f"the {sensor} stood at the end of its range in {count} samples ({share:.1%}); {remedy}"
        return Reason(code, sentence, share > MOST_CLIPPED)

    return check


def data_lost(e: Evidence) -> Reason | None:
    """Gaps."""
    gaps = e.recording.gap
    if not gaps.any():
        return None
    places = int(np.count_nonzero(gaps & ~np.append(False, gaps[:-1])))
    lost = float(np.diff(e.recording.t, prepend=e.recording.t[0])[gaps].sum())
    better = "a faster bus" if e.recording.autopilot is None else "a nearer or faster link"
    # a session that was resumed has a gap that no bus is to blame for
    return Reason(
        "data_lost",
        f"samples are missing in {places} place{'s' if places > 1 else ''} ({lost:.2f} s in all); unless the "
        f"measurement was interrupted there, use {better} or a lower rate",
        lost > 0.5 * float(e.recording.t[-1] - e.recording.t[0]),
    )


def _trustworthy(e: Evidence) -> bool:
    """Whether D and K are known well enough to conclude from them what is wrong with the sensor."""
    if e.fit is None or e.sure is None or not e.fit.converged or e.sure.rms_mps2 > USABLE_RMS_MPS2:
        return False
    contradiction = inconsistent(e)
    return contradiction is None or not contradiction.refuse


def wrong_range(e: Evidence) -> Reason | None:
    """All three gains near one power of two."""
    if e.fit is None or not _trustworthy(e):
        return None
    gains = np.diag(sensor_axes(e.fit.D))
    power = np.round(np.log2(gains)).astype(int)
    if power[0] == 0 or not (power == power[0]).all() or not (np.abs(gains / 2.0 ** power[0] - 1.0) < 0.05).all():
        return None
    return Reason(
        "wrong_range",
        f"all three gains are near {2.0 ** power[0]:g}: the accelerometer's range is not the one assumed (or it is an "
        "early revision with half the sensitivity); give the true range",
        True,
    )


def accelerometer_factor(e: Evidence) -> Reason | None:
    """All three gains off by one factor that is no range's, and far beyond what a sensor is off by."""
    if e.fit is None or not _trustworthy(e) or wrong_range(e) is not None:
        return None
    gains = np.diag(sensor_axes(e.fit.D))
    factor = float(gains.mean())
    if 1.0 / MOST_GAIN < factor < MOST_GAIN or not (np.abs(gains / factor - 1.0) < 0.05).all():
        return None
    return Reason(
        "units_suspect",
        f"all three gains are near {factor:.3g}, and no accelerometer is off by that: it seems to be in another unit "
        "than m/s^2; convert it to m/s^2",
        True,
    )


def axes(e: Evidence) -> Reason | None:
    """Axes that are mirrored or swapped against the gyroscope's."""
    if e.fit is None or not _trustworthy(e):
        return None
    U, _, Vt = np.linalg.svd(e.fit.D)
    Q = U @ Vt
    if np.arccos(np.clip((np.trace(Q) - 1.0) / 2.0, -1.0, 1.0)) <= WORST_AXES_RAD:
        return None
    # (D, u) and (-D, -u) fit equally, and D was made right-handed: a left-handed sensor shows as its mirror
    M = max(_SIGNED_PERMUTATIONS, key=lambda M: max(np.sum(M * Q), np.sum(M * -Q)) + 0.01 * np.trace(M))
    if (np.abs(M) == np.eye(3)).all():
        flipped = [axis for axis, sign in zip("xyz", np.diag(M), strict=True) if sign < 0]
        return Reason(
            "left_handed",
            "the accelerometer's axes are left-handed against the gyroscope's: change the sign of its "
            f"{' and '.join(flipped)} axis",
            True,
        )
    order = ", ".join(("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))] for row in M)
    return Reason(
        "swapped_axes",
        f"the accelerometer's axes x, y, z lie along the gyroscope's {order}: name them so that both agree",
        True,
    )


_SIGNED_PERMUTATIONS = [
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in permutations(range(3))
    for signs in choices((1.0, -1.0), repeat=3)
]


def gyro_off(e: Evidence) -> Reason | None:
    """A gyroscope beyond what its data sheet allows."""
    if e.fit is None or not _trustworthy(e):
        return None
    off = e.fit.K - np.eye(3)
    scale, cross = np.abs(np.diag(off)), np.abs(off - np.diag(np.diag(off)))
    if scale.max() <= GYRO_SCALE_OFF and cross.max() <= GYRO_CROSS_OFF:
        return None
    axis = int(np.argmax(scale))
    return Reason(
        "gyro_off",
        f"the gyroscope is off by {scale[axis]:.1%} on {'xyz'[axis]} and {cross.max():.1%} across axes, more than its "
        "data sheet allows; check its range and the sample rate",
        False,
    )


def temperature_moved(e: Evidence) -> Reason | None:
    """A sensor that warmed or cooled while it was measured."""
    known = e.recording.temperature_c[np.isfinite(e.recording.temperature_c)]
    if len(known) < 10:
        return None
    low, high = np.quantile(known, [0.02, 0.98])
    if high - low <= WARMER_C:
        return None
    return Reason(
        "temperature_moved",
        f"the temperature moved from {low:.1f} to {high:.1f} C, and the biases with it; let the board warm up first",
        False,
    )


def not_converged(e: Evidence) -> Reason | None:
    """A minimiser that did not settle."""
    if e.fit is None or e.fit.converged:
        return None
    return Reason(
        "not_converged",
        f"the estimate had not settled after {e.fit.iterations} iterations; record again, with slower turns and pauses",
        True,
    )


def inconsistent(e: Evidence) -> Reason | None:
    """Data that the model does not explain: innovations beyond white noise, rests that contradict the estimate."""
    if e.fit is None or e.sure is None:
        return None
    # a robust model leaves outliers in its innovations: only the others are judged by them
    if e.model != "hand" and e.fit.nis > CONSISTENT_NIS:
        after = float(np.median(np.linalg.norm(e.calibrated, axis=1))) if e.calibrated is not None else np.nan
        return Reason(
            "inconsistent",
            f"the model does not explain the data (normalised innovations {e.fit.nis:.0f}, expected 3): a hand's own "
            "acceleration or the gyroscope's scale; use --model hand, turn slowly, and rest the board often",
            not abs(after / e.gravity - 1.0) < 0.05,
        )
    if e.rests is None:
        return None
    rests = e.rests
    magnitude = rests.magnitude_rms > max(RESTS_MPS2, HONEST_FACTOR * e.sure.magnitude_mps2)
    direction = rests.miss_median > max(RESTS_RAD, HONEST_FACTOR * e.sure.direction_rad)
    if not (magnitude or direction):
        return None
    return Reason(
        "inconsistent",
        f"the rests contradict each other: |a| differs from gravity by {rests.magnitude_rms:.2g} m/s^2, and gravity "
        f"carried by the gyroscope misses by {np.rad2deg(rests.miss_median):.1f} deg; is the sensor fast on its board? "
        "Rest the board when you pause, and turn more slowly",
        rests.magnitude_rms > 5.0 * RESTS_MPS2 or rests.miss_median > 5.0 * RESTS_RAD,
    )


def changed_midway(e: Evidence) -> Reason | None:
    """A mount that slipped or a bias that stepped, where nothing else speaks against the estimate.

    Lost and clipped samples pull at an estimate too, and have reasons of their own.
    """
    if e.model == "tilt" or not _trustworthy(e) or inconsistent(e) is not None or few_orientations(e) is not None:
        return None
    r = e.recording
    if r.gyr_clipped.any() or r.acc_clipped.any() or r.gap.any() or e.change is None:
        return None
    if e.change.rests_often and _agree(e.rests):
        return None
    limit = STEADY_BY_RESTS if e.change.rests_often else STEADY
    if e.change.significance <= limit:
        return None
    return Reason(
        "inconsistent",
        f"the sensor was not the same before and after about {e.change.t_s - r.t[0]:.0f} s: what each part of the "
        "recording says of it differs by more than noise; did its mount slip, or something knock it? Fasten it and "
        "record again",
        e.change.significance > UNSTEADY_BY_FAR * limit,
    )


def _agree(rests: Rests | None) -> bool:
    return rests is not None and rests.magnitude_rms < AGREE_MPS2 and rests.miss_median < AGREE_RAD


def tilted_only(e: Evidence) -> Reason | None:
    """Parameters of which tilts say nothing."""
    if e.model != "tilt" or e.fit is None:
        return None
    left = [name for name in e.fit.at_prior if name.startswith(("D_", "b_a_"))]
    named = f"; {', '.join(left)} stay as assumed beforehand and are not claimed" if left else ""
    return Reason(
        "few_orientations",
        f"the board was only tilted, and the calibration holds within {np.rad2deg(CONE_RAD):.0f} deg of how it lay"
        f"{named}; turn it over to know the rest",
        False,
    )


CHECKS: tuple[Check, ...] = (
    moved_while_still,
    tilted_only,
    few_orientations,
    clipped("gyro_clipped", "gyroscope", "turn more slowly, or choose a larger range", lambda r: r.gyr_clipped),
    clipped("accel_clipped", "accelerometer", "move more gently, or choose a larger range", lambda r: r.acc_clipped),
    data_lost,
    wrong_range,
    accelerometer_factor,
    axes,
    gyro_off,
    temperature_moved,
    not_converged,
    inconsistent,
    changed_midway,
)
