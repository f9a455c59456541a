"""How far the estimate moves when a part of the recording is left out: by time, and by the side that was down.

Delete-a-group jackknife: with theta_k the estimate without group k, sqrt((K - 1) / K sum |theta_k - theta|^2) is its
standard deviation whatever the noise is, as long as the groups err independently. What errs by time (drift, a knock,
vibration) disagrees between times; what errs by orientation (nonlinearity, hysteresis, the gyroscope's sensitivity to
acceleration) is alike at all times, and disagrees between sides.

Source: Busing, Meijer, van der Leeden, "Delete-m jackknife for unequal m" (1999); the spread is the median of the
groups', 1.2 times, which one group that holds all of an orientation cannot blow up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..data import Vector
from .levenberg_marquardt import inverse
from .parameters import ACCELEROMETER
from .parts import Parts

TIMES, FEWEST_GROUPS = 8, 4
ROBUST = 1.2
# the jackknife by side is this many times what it is by chance at most, times how much more than by chance sides differ
MOST_BY_CHANCE, TINY_MPS2 = 3.0, 1e-9
# of the jackknife that is claimed: less than all of it, since the groups are few and not alike
OF_TIME, OF_SIDE = 0.7, 0.75


@dataclass(frozen=True)
class Jackknife:
    """What the estimate's error is by leaving parts out: rms over all directions of gravity [m/s^2].

    Attributes
    ----------
    time, side : by groups of time and of orientation; 0 where there are too few of them.
    worst : s after the flat segment, first and last, of the time that moves the estimate most when it is left out.
    """

    time: float
    side: float
    worst: tuple[float, float]

    def claim(self) -> float:
        """m/s^2 that is claimed at least."""
        return max(OF_TIME * self.time, OF_SIDE * self.side)

    def decided_by(self) -> Literal["time", "side"]:
        """Which of the two is larger."""
        return "time" if OF_TIME * self.time >= OF_SIDE * self.side else "side"


def jackknife(parts: Parts, D: Vector, gravity: float) -> Jackknife:
    """By the parts' scores: one Newton step from the estimate leads to that without a group, weights and noise held."""
    groups = parts.by_time(min(TIMES, len(parts)))
    to_sphere = _to_sphere(D, gravity)
    gradient, fisher = parts.grouped(groups)
    by_time = _moved(gradient, parts.H - fisher, to_sphere)
    gradient, fisher = parts.grouped(parts.side)
    by_side = _moved(gradient, parts.H - fisher, to_sphere)
    # without a side that few others make up for, the estimate moves far by chance
    chance = _rms(inverse(parts.H - fisher) - parts.covariance, to_sphere)
    most = MOST_BY_CHANCE * float(np.median(by_side / chance)) * float(_rms(parts.covariance, to_sphere))
    worst = np.flatnonzero(groups == int(np.argmax(by_time)))
    span = float(parts.start[worst[0]]), float(parts.end[worst[-1]])
    return Jackknife(_spread(by_time), min(_spread(by_side), most), span)


def _to_sphere(D: Vector, gravity: float) -> Vector:
    """(12, 12) takes an error of (D row-major, b_a) to twelve numbers whose squares add up to its mean square [m/s^2].

    A calibrated reading moves by inv(D) (dD s + db), and the mean of |A s + c|^2 over |s| = g is g^2/3 |A|^2 + |c|^2.
    """
    back, result = np.linalg.inv(D), np.zeros((12, 12))
    result[:9, :9] = gravity / np.sqrt(3.0) * np.kron(back, np.eye(3))
    result[9:, 9:] = back
    return result


def _moved(gradient: Vector, H: Vector, to_sphere: Vector) -> Vector:
    """(m,) m/s^2, rms over the sphere, by which the estimate without each group differs from their median.

    Infinite where a group is all that tells a parameter.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(H, axis1=1, axis2=2), 1e-300))
    try:
        step = np.linalg.solve(H * scale[:, :, None] * scale[:, None, :], (gradient * scale)[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        return np.full(len(gradient), np.inf)
    step = (step * scale)[:, ACCELEROMETER]
    step = step - np.median(step, axis=0)
    return np.asarray(np.linalg.norm(step @ to_sphere.T, axis=1))


def _rms(covariance: Vector, to_sphere: Vector) -> Vector:
    """(...,) m/s^2 over the sphere, of covariances (..., p, p)."""
    of = covariance[..., ACCELEROMETER, ACCELEROMETER]
    trace = np.trace(to_sphere @ of @ to_sphere.T, axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.maximum(trace, TINY_MPS2**2)))


def _spread(moved: Vector) -> float:
    if len(moved) < FEWEST_GROUPS or not np.isfinite(moved).all():
        return 0.0
    return float(ROBUST * np.sqrt(len(moved) - 1) * np.median(moved))
