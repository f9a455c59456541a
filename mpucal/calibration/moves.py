"""Moves between rests whose gyroscope cannot be believed: a line drawn through lost samples, a slip of the mount."""

from __future__ import annotations

import numpy as np

from ..data import Recording, Vector
from .likelihood import Series, Theta
from .model import Flat, product, rotation
from .still import Runs

POSE_MPS2 = 0.003
DEGREES_OF_FREEDOM = 4.0
# a weight so small that a move says nothing beside the others
WORTHLESS = 0.02


def q_scale_of_moves(
    recording: Recording, flat: Flat, series: Series, theta: Theta, runs: Runs, gravity: float
) -> Vector | None:
    """(n,) factor of Sigma_omega over the series, large on moves that disagree with the others; None where none does.

    The gravity of one rest, carried to the next by the gyroscope, misses it by e; z = |e|^2 / (2 v) with v what noise
    explains; Student's t gives each move its weight, against the common scale of all moves.
    """
    F = rotation(-series.dt[:, None] * ((series.omega - theta.b_omega) @ theta.K.T))
    spans, v, z, noise = [], [], [], []
    inverse = np.linalg.pinv(theta.D)  # a search may pass through a singular D: that is no reason to stop it
    poses = [inverse @ (recording.acc[a:b].mean(0) - theta.b_a) for a, b in runs]
    for k in range(len(runs) - 1):
        first, last = max(runs[k][1] - flat.last, 0), runs[k + 1][0] - flat.last + 1
        if last <= 0:
            continue
        e = _miss(product(F[first:last]) @ poses[k], poses[k + 1])
        at_rest = sum(1.0 / (b - a) for a, b in runs[k : k + 2])
        of_gyro = float(np.sum(series.dt[first:last] ** 2) * flat.Sigma_omega.mean())
        known = of_gyro + (0.0 if series.q_extra is None else float(series.q_extra[first:last].sum()))
        variance = known + (2.0 * POSE_MPS2**2 + flat.Sigma_a.mean() * at_rest) / gravity**2
        spans.append(slice(first, last))
        v.append(variance)
        z.append(0.5 * float(e @ e) / variance)
        noise.append(of_gyro)
    if len(z) < 3:
        return None
    weight, scale = _weights(np.array(z))
    if not (weight < WORTHLESS).any():
        return None
    factor = np.ones(len(series))
    for span, w, variance, of_gyro in zip(spans, weight, v, noise, strict=True):
        if w < WORTHLESS:
            factor[span] = max(scale / w * variance / of_gyro, 1.0)
    return factor


def _miss(carried: Vector, seen: Vector) -> Vector:
    """(3,) sine of the angle between two directions, along their axis."""
    return np.cross(carried, seen) / (np.linalg.norm(carried) * np.linalg.norm(seen))


def _weights(z: Vector) -> tuple[Vector, float]:
    """Student-t weights (k,) of the moves, and the scale c >= 1 of the moves that agree."""
    nu, c = DEGREES_OF_FREEDOM, 1.0
    for _ in range(50):
        w = (nu + 2.0) / (nu + 2.0 * z / c)
        c = max(1.0, float(np.mean(w * z)))
    return (nu + 2.0) / (nu + 2.0 * z / c), c
