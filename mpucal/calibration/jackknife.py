"""Delete-a-group jackknife: the spread of the estimate without a stretch of time, or without a side that was down.

With theta_k the estimate without group k, sqrt((K - 1) / K sum |theta_k - theta|^2) is its standard deviation under any
noise, if the groups err independently. Errors by time (drift, a knock, vibration) disagree between times; errors by
orientation (nonlinearity, hysteresis, the gyroscope's sensitivity to acceleration) are alike at all times, and disagree
between sides.

Source: Busing, Meijer, van der Leeden, "Delete-m jackknife for unequal m" (1999). The spread here is 1.2 times the
median of the groups', so that one group that holds all of an orientation cannot enlarge it.
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
# The spread by sides is at most so many times the model's, times the ratio by which sides differ more than by chance.
MOST_BY_CHANCE, TINY_MPS2 = 3.0, 1e-9
# Shares of the spread that are claimed: not all of it, since the groups are few and not alike.
OF_TIME, OF_SIDE = 0.7, 0.75


@dataclass(frozen=True)
class Jackknife:
    """Error of the estimate by leaving parts out, rms over all directions of gravity [m/s^2].

    Attributes
    ----------
    time, side : by groups of time and of orientation; 0 where there are too few of them.
    worst : s after the flat segment, first and last, of the time that moves the estimate most when it is left out.
    """

    time: float
    side: float
    worst: tuple[float, float]

    def claim(self) -> float:
        """Return the least error to be claimed [m/s^2]."""
        return max(OF_TIME * self.time, OF_SIDE * self.side)

    def decided_by(self) -> Literal["time", "side"]:
        """Return the kind of group with the larger claim."""
        return "time" if OF_TIME * self.time >= OF_SIDE * self.side else "side"


def jackknife(parts: Parts, D: Vector, gravity: float) -> Jackknife:
    """Compute the jackknife by the parts' scores: one Newton step leads to the estimate without a group."""
    groups = parts.by_time(min(TIMES, len(parts)))
    to_sphere = _to_sphere(D, gravity)
    gradient, fisher = parts.grouped(groups)
    by_time = _moved(gradient, parts.H - fisher, to_sphere)
    gradient, fisher = parts.grouped(parts.side)
    by_side = _moved(gradient, parts.H - fisher, to_sphere)
    # Without a side that no other can replace, the estimate moves far by chance.
    chance = _rms(inverse(parts.H - fisher) - parts.covariance, to_sphere)
    most = MOST_BY_CHANCE * float(np.median(by_side / chance)) * float(_rms(parts.covariance, to_sphere))
    worst = np.flatnonzero(groups == int(np.argmax(by_time)))
    span = float(parts.start[worst[0]]), float(parts.end[worst[-1]])
    return Jackknife(_spread(by_time), min(_spread(by_side), most), span)


def _to_sphere(D: Vector, gravity: float) -> Vector:
    """Return (12, 12), which maps an error of (D row-major, b_a) to numbers whose squares add up to its mean square.

    A calibrated reading moves by inv(D) (dD s + db), and the mean of |A s + c|^2 over |s| = g is g^2/3 |A|^2 + |c|^2.
    """
    back, result = np.linalg.inv(D), np.zeros((12, 12))
    result[:9, :9] = gravity / np.sqrt(3.0) * np.kron(back, np.eye(3))
    result[9:, 9:] = back
    return result


def _moved(gradient: Vector, H: Vector, to_sphere: Vector) -> Vector:
    """Return (m,) m/s^2, rms over the sphere, the distance of the estimate without each group from their median.

    It is infinite where a parameter is determined by one group alone.
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
    """Return the rms error [m/s^2] over the sphere (...,) of covariances (..., p, p)."""
    of = covariance[..., ACCELEROMETER, ACCELEROMETER]
    trace = np.trace(to_sphere @ of @ to_sphere.T, axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.maximum(trace, TINY_MPS2**2)))


def _spread(moved: Vector) -> float:
    if len(moved) < FEWEST_GROUPS or not np.isfinite(moved).all():
        return 0.0
    return float(ROBUST * np.sqrt(len(moved) - 1) * np.median(moved))
