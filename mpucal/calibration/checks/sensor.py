"""Checks of the sensor by a trustworthy fit: its range, units and axes, the gyroscope, and the clock."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...data import MOST_CLOCK_PPM, Mask, Vector
from ...origin import Origin
from ...reasons import Reason, reason
from ...rests.windows import WINDOW_S
from ...result.correlation import UPPER
from ...result.error_model import nearest_rotation, sensor_axes
from ..evidence import Evidence, once
from ..hypothesis_tests import LAG_S, MOST_STD
from ..parameters import BY_NAME
from ..rotation import signed_permutations
from ..transitions import MOST_MISS_RAD
from .estimate import GOOD_RMS_MPS2, USABLE_RMS_MPS2, exchange, inconsistent, likely_slip

WORST_AXES_RAD = np.deg2rad(60.0)
# Of all three scale factors alike: data sheets say 3 %, and chips that were soldered by hand are within 5 %; beyond
# MOST_SCALE, or its inverse, the unit is wrong: the paper simulates sensors of 0.5 to 1.5.
SCALE_OFF, MOST_SCALE = 0.1, 2.5
ALIKE = MOST_STD * BY_NAME["K"].sd[0]  # largest difference of three scale factors that agree on one
# These models estimate no scale factor of the gyroscope.
TRUSTING = ("accel", "paper", "tilt")


@once
def is_trustworthy(e: Evidence) -> bool:
    """Return True if D and K are known well enough to conclude from them what is wrong with the sensor."""
    if e.fit is None or e.uncertainty is None or not e.fit.converged or e.uncertainty.rms_mps2 > USABLE_RMS_MPS2:
        return False
    contradiction = inconsistent(e)
    return contradiction is None or not contradiction.refuse


def scale_factors(e: Evidence) -> Reason | None:
    """Find three scale factors that are wrong by one factor: another range's, or more than a sensor's error."""
    scale = np.diag(sensor_axes(e.estimate.D))  # along the accelerometer's own axes, which may be swapped or turned
    factor = float(scale.mean())
    power = 2.0 ** round(math.log2(factor))
    if power != 1.0 and (np.abs(scale / power - 1.0) < ALIKE).all():
        return reason("wrong_range", "power_of_two", factor=power)
    if abs(factor - 1.0) < SCALE_OFF or not (np.abs(scale / factor - 1.0) < ALIKE).all():
        return None
    far = not 1.0 / MOST_SCALE < factor < MOST_SCALE
    return reason("units_suspect", "scale_factors" if far else "alike", factor=factor)


def axes(e: Evidence) -> Reason | None:
    """Find axes that are mirrored or swapped relative to the gyroscope's."""
    Q = nearest_rotation(e.estimate.D)
    if np.arccos(np.clip((np.trace(Q) - 1.0) / 2.0, -1.0, 1.0)) <= WORST_AXES_RAD:
        return None
    return _named_axes(e, max(signed_permutations(), key=lambda M: float(abs(np.sum(M * Q)) + 0.01 * np.trace(M))))


def _named_axes(e: Evidence, M: Vector) -> Reason:
    """Return the reason for axes M (3, 3) of the accelerometer against the gyroscope's, or for -M."""
    # (D, u) and (-D, -u) fit equally: the reading of the board that lies face up decides between them.
    if not _reads_up(e, M):
        M = -M
    if (np.abs(M) == np.eye(3)).all():
        return reason("left_handed", "axes", axes=_named(np.diag(M) < 0), others=_named(np.diag(M) > 0))
    order = ", ".join(("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))] for row in M)
    return reason("swapped_axes", "axes", order=order)


def _reads_up(e: Evidence, M: Vector) -> bool:
    """Return True if the board, lying face up, reads +g on z once the axes M (3, 3) are undone.

    Where it lay on another side, return True for the M that changes fewer signs.
    """
    flat = M.T @ e.flat_segment.y
    return bool(flat[2] > 0.0) if np.abs(flat).argmax() == 2 else bool(np.trace(M) > 0.0)


def _named(axes: Mask) -> str:
    names = [name for name, chosen in zip("xyz", axes, strict=True) if chosen]
    return f"{' and '.join(names)} {'axis' if len(names) == 1 else 'axes'}"


def gyro_range(e: Evidence) -> Reason | None:
    """Find rates that are all a power of two too small or too large for how gravity turned from rest to rest."""
    if (is_trustworthy(e) and _is_within_tolerance(e.estimate.K)) or e.gyro_factor == 1.0:
        return None
    assumed = e.recording.sensor.gyro_range_dps
    ranges = "" if assumed is None else f": ±{e.gyro_factor * assumed:g} deg/s, read as ±{assumed:g}"
    return reason("gyro_off", "range", factor=e.gyro_factor, ranges=ranges)


def gyro_contradicts(e: Evidence) -> Reason | None:
    """Find rates, within the range or beyond it, that carry gravity far away from where it is at the next rest.

    A slip of the mount explains that by itself, and so do axes that were exchanged midway.
    """
    if likely_slip(e) is not None or exchange(e) is not None:
        return None
    if is_trustworthy(e) and e.uncertainty is not None:
        # Where white noise explains the samples, the rates carry gravity to each of them.
        carried = e.model in ("accel", "imu") and inconsistent(e) is None
        if carried or e.uncertainty.rms_mps2 <= GOOD_RMS_MPS2:
            return None
    if e.turned_unrecorded:
        return reason("gyro_off", "interrupted")
    within, of_all = e.gyro_miss
    if within > MOST_MISS_RAD:
        if (by := e.gyro_axes) is not None:
            return _named_axes(e, by) if np.linalg.det(by) > 0.0 else reason("left_handed", "both")
        return reason("gyro_off", "contradicts", degrees=np.rad2deg(within))
    return reason("gyro_clipped", "contradicts", degrees=np.rad2deg(of_all)) if of_all > MOST_MISS_RAD else None


def gyro_off(e: Evidence) -> Reason | None:
    """Find a gyroscope outside the tolerances of its data sheet; rates beyond its range pull at K, too."""
    if e.recording.gyr_clipped.any() or _is_within_tolerance(e.estimate.K):
        return None
    scale, cross = _gyro_errors(e.estimate.K)
    axis = int(np.argmax(scale))
    return reason("gyro_off", "scale", axis="xyz"[axis], scale=scale[axis], cross=cross)


def _is_within_tolerance(K: Vector) -> bool:
    known = BY_NAME["K"]
    return bool((np.abs(K - np.eye(3))[UPPER] <= MOST_STD * np.array(known.sd)).all())


def _gyro_errors(K: Vector) -> tuple[Vector, float]:
    """Return the sizes of the scale factor errors (3,), and of the largest cross-axis sensitivity."""
    off = np.abs(K - np.eye(3))
    return np.diag(off), float((off - np.diag(np.diag(off))).max())


def clock_off(e: Evidence) -> Reason | None:
    """Find a clock whose rate was corrected by much, or is hardly known: the gyroscope's K has the same error."""
    ppm, std = e.recording.sensor.clock_ppm, e.recording.sensor.clock_std
    if ppm is None or std is None:
        return None
    if std > 1e-6 * MOST_CLOCK_PPM:
        if e.model in TRUSTING:
            return reason("clock_off", "trusted", std=std * 1e6, model=e.model)
        return reason("clock_off", "unknown", std=std * 1e6)
    return reason("clock_off", "corrected", ppm=ppm, std=std * 1e6) if abs(ppm) > MOST_CLOCK_PPM else None


def sensors_lag(e: Evidence) -> Reason | None:
    """Find an accelerometer that lags behind the gyroscope, or runs ahead of it, by more than filters explain."""
    # The filters of an autopilot are set by its owner, and differ.
    if e.claim is None or e.recording.sensor.origin is Origin.VEHICLE:
        return None
    if e.claim.change is not None or exchange(e) is not None:  # a sensor that changed looks late
        return None
    (of_prior,) = BY_NAME["tau"].sd
    std = float(replace(e.estimate, covariance=e.claim.covariance).std("tau")[0])
    # The prior draws the estimate towards the filters' delay: remove it, to have what the data alone say.
    data, filters_s = 1.0 - (std / of_prior) ** 2, e.recording.sensor.accel_lag_s
    lag_s = filters_s + (e.estimate.delay_s - filters_s) / data if data > 0.0 else 0.0
    # Rates change within a longer time: what looks like such a delay has another cause.
    if not data > 0.0 or not max(LAG_S, MOST_STD * std / data**0.5) <= abs(lag_s) < WINDOW_S:
        return None
    return reason("clock_off", "apart", lag=1e3 * abs(lag_s), how="lags behind" if lag_s > 0 else "runs ahead of")
