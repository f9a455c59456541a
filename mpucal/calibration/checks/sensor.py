"""Checks of what a fit says of the sensor: its range, units and axes, and the gyroscope's scale factors."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from ...data import Mask, Vector
from ...reasons import Reason, reason
from ...result.error_model import sensor_axes
from ..evidence import MOST_MISS_RAD, Evidence
from .estimate import USABLE_RMS_MPS2, inconsistent

WORST_AXES_RAD = np.deg2rad(60.0)
GYRO_SCALE_OFF, GYRO_CROSS_OFF = 0.06, 0.04
# one way or the other; the paper simulates sensors of 0.5 to 1.5
MOST_SCALE = 2.5
# of all three alike: data sheets say 3 %, and chips that were soldered by hand are within 5 %
SCALE_OFF = 0.1
# so well three scale factors agree on one
ALIKE = 0.05


def trustworthy(e: Evidence) -> bool:
    """Whether D and K are known well enough to conclude from them what is wrong with the sensor."""
    if e.fit is None or e.sure is None or not e.fit.converged or e.sure.rms_mps2 > USABLE_RMS_MPS2:
        return False
    contradiction = inconsistent(e)
    return contradiction is None or not contradiction.refuse


def wrong_range(e: Evidence) -> Reason | None:
    """All three scale factors near one power of two."""
    if e.fit is None or not trustworthy(e):
        return None
    scale = _scale_factors(e.fit.D)
    power = np.round(np.log2(scale)).astype(int)
    if power[0] == 0 or not (power == power[0]).all() or not (np.abs(scale / 2.0 ** power[0] - 1.0) < ALIKE).all():
        return None
    return reason("wrong_range", "power_of_two", factor=2.0 ** power[0])


def accelerometer_factor(e: Evidence) -> Reason | None:
    """All three scale factors off by one factor that is no range's, and beyond what a sensor is off by."""
    if e.fit is None or not trustworthy(e) or wrong_range(e) is not None:
        return None
    scale = _scale_factors(e.fit.D)
    factor = float(scale.mean())
    if abs(factor - 1.0) < SCALE_OFF or not (np.abs(scale / factor - 1.0) < ALIKE).all():
        return None
    far = not 1.0 / MOST_SCALE < factor < MOST_SCALE
    return reason("units_suspect", "scale_factors" if far else "alike", factor=factor)


def _scale_factors(D: Vector) -> Vector:
    """(3,) along the accelerometer's own axes, which may be swapped or turned."""
    return np.diag(sensor_axes(D))


def axes(e: Evidence) -> Reason | None:
    """Axes that are mirrored or swapped against the gyroscope's."""
    if e.fit is None or not trustworthy(e):
        return None
    U, _, Vt = np.linalg.svd(e.fit.D)
    Q = U @ Vt
    if np.arccos(np.clip((np.trace(Q) - 1.0) / 2.0, -1.0, 1.0)) <= WORST_AXES_RAD:
        return None
    # (D, u) and (-D, -u) fit equally: which of them it is, what the board reads as it lies face up decides
    M = max(_SIGNED_PERMUTATIONS, key=lambda M: float(abs(np.sum(M * Q)) + 0.01 * np.trace(M)))
    if not _reads_up(e, M):
        M = -M
    if (np.abs(M) == np.eye(3)).all():
        return reason("left_handed", "axes", axes=_named(np.diag(M) < 0), others=_named(np.diag(M) > 0))
    order = ", ".join(("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))] for row in M)
    return reason("swapped_axes", "axes", order=order)


def _reads_up(e: Evidence, M: Vector) -> bool:
    """True where the board, lying face up, reads +g on z once the axes M (3, 3) are undone.

    Where it lay on another side, M is preferred that changes fewer signs.
    """
    flat = np.zeros(3) if e.flat is None else M.T @ e.flat.y
    return bool(flat[2] > 0.0) if np.abs(flat).argmax() == 2 else bool(np.trace(M) > 0.0)


def _named(axes: Mask) -> str:
    names = [name for name, chosen in zip("xyz", axes, strict=True) if chosen]
    return f"{' and '.join(names)} {'axis' if len(names) == 1 else 'axes'}"


_SIGNED_PERMUTATIONS = [
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
]


def gyro_range(e: Evidence) -> Reason | None:
    """Rates that are all a power of two too small or too large for how gravity turned from rest to rest."""
    if e.fit is None or trustworthy(e) or e.gyro_factor == 1.0:
        return None
    assumed = e.recording.sensor.gyro_range_dps
    ranges = "" if assumed is None else f": ±{e.gyro_factor * assumed:g} deg/s, read as ±{assumed:g}"
    return reason("gyro_off", "range", factor=e.gyro_factor, ranges=ranges)


def gyro_contradicts(e: Evidence) -> Reason | None:
    """Rates that lead gravity far away from where it is at the next rest."""
    if e.fit is None or trustworthy(e) or not e.gyro_miss > MOST_MISS_RAD:
        return None
    return reason("gyro_off", "contradicts", degrees=np.rad2deg(e.gyro_miss))


def gyro_off(e: Evidence) -> Reason | None:
    """A gyroscope beyond what its data sheet allows."""
    if e.fit is None or not trustworthy(e):
        return None
    off = e.fit.K - np.eye(3)
    scale, cross = np.abs(np.diag(off)), np.abs(off - np.diag(np.diag(off)))
    if scale.max() <= GYRO_SCALE_OFF and cross.max() <= GYRO_CROSS_OFF:
        return None
    axis = int(np.argmax(scale))
    return reason("gyro_off", "scale", axis="xyz"[axis], scale=scale[axis], cross=cross.max())
