"""Whether the sensor changed while the board was turned: a random walk over the parts, its size by likelihood.

Three things may have changed: the accelerometer's bias (a step, warming), the gyroscope's, the accelerometer's mount.
Beside theta every part has three numbers delta_k of one of them, delta_0 ~ N(0, q) and delta_k - delta_k-1 ~ N(0, q).
A fourth explanation is no change at all: a sensor whose bias depends on which side is down, as a nonlinear one's does;
then each side has a delta ~ N(0, q) of its own.

To second order all that is needed are the parts' scores. With theta eliminated and delta in independent x, the
quadratic form is S + I/q, and by the eigenvalues of S the marginal likelihood of every q is a sum:

    2 log p(q)/p(0) = sum c^2 / (lambda + 1/q) - log(1 + q lambda)

Where nothing changed, c^2 / lambda is 1 on average for each eigenvector. A change is in few of them, those that are
slow; where parts differ by what no model holds (a pivot that swings), all are larger. So what nothing but a change
explains is the gain with c^2 over the median of them all.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from .levenberg_marquardt import inverse
from .parameters import PLACES
from .parts import Parts
from .rotation import cross

What = Literal["accelerometer", "gyroscope", "mount", "side"]

TIMES = 16
# variance of a step from part to part: (m/s^2)^2, (rad/s)^2 and rad^2
STEPS: dict[What, Vector] = {
    "accelerometer": 10.0 ** np.arange(-8.0, -2.9, 0.5),
    "gyroscope": 10.0 ** np.arange(-11.0, -2.9, 0.5),
    "mount": 10.0 ** np.arange(-8.0, -1.9, 0.5),
    "side": 10.0 ** np.arange(-8.0, -0.9, 0.5),
}
# twice the logarithm of how much likelier a walk must be than none; sensors that stayed reach 10
SIGNIFICANT = 20.0
# the median of the square of a normal variable; an eigenvector of less than so much of the largest is not seen
MEDIAN_SQUARE, UNSEEN = 0.455, 1e-9


class BiasWalk(NamedTuple):
    """The likeliest walk.

    Attributes
    ----------
    what : changed. gain : 2 log of how much likelier it is than none. q : variance of a step from part to part.
    alone : the gain where all eigenvectors are taken to be as loud as their median is.
    delta : (k, 3) from the estimate, m/s^2, rad/s or rad. t : (k,) s after the flat segment, the middles of the parts;
    of sides none.
    """

    what: What
    gain: float
    alone: float
    q: float
    delta: Vector
    t: Vector

    def error(self, gravity: float) -> float:
        """m/s^2 by which readings before and after are off; 0 where it is no change of the accelerometer."""
        return 0.5 * self.size * {"accelerometer": 1.0, "mount": gravity}.get(self.what, 0.0)

    @property
    def size(self) -> float:
        """From one end of what it was to the other."""
        return float(np.linalg.norm(np.ptp(self.delta, axis=0)))

    @property
    def steepest(self) -> tuple[float, float]:
        """s after the flat segment, between which it changed most."""
        at = int(np.linalg.norm(np.diff(self.delta, axis=0), axis=1).argmax())
        return float(self.t[at]), float(self.t[at + 1])

    def at(self, t: Vector) -> Vector:
        """(n, 3) drawn straight between the middles, beginning at 0 where the turning begins."""
        at, delta = np.concatenate([[0.0], self.t]), np.vstack([np.zeros(3), self.delta])
        return np.stack([np.interp(t, at, column) for column in delta.T], axis=1)


def find_walk(parts: Parts, D: Vector) -> BiasWalk | None:
    """Of what changed most likely; None where nothing did, beyond chance, or a fit that failed cannot say."""
    if not (np.isfinite(parts.H).all() and np.isfinite(D).all()):
        return None
    times = parts.by_time(min(TIMES, len(parts)))
    first = np.searchsorted(times, np.arange(times[-1] + 1))
    last = np.append(first[1:], len(parts)) - 1
    middles = 0.5 * (parts.start[first] + parts.end[last])
    by_time = parts.grouped(times)
    walks = [_walk(what, parts, D, *by_time, middles) for what in STEPS if what != "side"]
    walk = max(*walks, _walk("side", parts, D, *parts.grouped(parts.side), middles[:0]), key=lambda walk: walk.gain)
    return walk if walk.gain > SIGNIFICANT else None


def remove_walk(recording: Recording, flat: Flat, walk: BiasWalk) -> Recording:
    """With a walk of the gyroscope's bias taken from its rates."""
    return replace(recording, gyr=recording.gyr - walk.at(np.maximum(recording.t - recording.t[flat.last - 1], 0.0)))


def walked_covariance(parts: Parts, D: Vector, q: float) -> Vector:
    """(p, p) covariance of theta where the gyroscope's bias walks by q [(rad/s)^2] from part to part."""
    gradient, fisher = parts.grouped(parts.by_time(min(TIMES, len(parts))))
    k, B = len(gradient), _directions("gyroscope", D, len(parts.H))
    back = np.kron(np.eye(k) - np.eye(k, k=-1), np.eye(3))
    M = _block_diagonal(B.T @ fisher @ B) + back.T @ back / q
    across = (fisher @ B).transpose(1, 0, 2).reshape(-1, 3 * k)
    return inverse(parts.H - across @ np.linalg.solve(M, across.T))


def _directions(what: What, D: Vector, p: int) -> Vector:
    """(p, 3) by which the three numbers move the parameters."""
    B = np.zeros((p, 3))
    if what == "mount":
        B[PLACES["D"]] = (D @ cross(np.eye(3))).reshape(3, 9).T
    else:
        B[PLACES["b_omega" if what == "gyroscope" else "b_a"]] = np.eye(3)
    return B


def _block_diagonal(blocks: Vector) -> Vector:
    """(3 k, 3 k) with the blocks (k, 3, 3) along its diagonal."""
    k = len(blocks)
    M, at = np.zeros((k, 3, k, 3)), np.arange(k)
    M[at, :, at] = blocks
    return M.reshape(3 * k, 3 * k)


@cache
def _sums(k: int) -> Vector:
    """(3 k, 3 k) adds up k vectors of three numbers: each with all before it."""
    return np.asarray(np.kron(np.tri(k), np.eye(3)))


def _walk(what: What, parts: Parts, D: Vector, gradient: Vector, fisher: Vector, t: Vector) -> BiasWalk:
    k, B = len(gradient), _directions(what, D, len(parts.H))
    to_theta = fisher @ B  # (k, p, 3)
    S = _block_diagonal(B.T @ to_theta)
    across = to_theta.transpose(1, 0, 2).reshape(-1, 3 * k)
    # how theta follows a delta
    follow = across.T @ parts.covariance
    S -= follow @ across
    # the deltas of a walk are sums of x
    sums = np.eye(3 * k) if what == "side" else _sums(k)
    eigenvalues, U = np.linalg.eigh(sums.T @ S @ sums)
    eigenvalues = np.maximum(eigenvalues, 0.0)
    c = U.T @ (sums.T @ (follow @ parts.left - (gradient @ B).ravel()))
    q = STEPS[what][:, None]
    seen = eigenvalues > UNSEEN * eigenvalues[-1]
    loud = max(float(np.median(c[seen] ** 2 / eigenvalues[seen])) / MEDIAN_SQUARE, 1.0)
    gain, alone = (
        np.sum(square / (eigenvalues + 1.0 / q) - np.log1p(q * eigenvalues), axis=1) for square in (c**2, c**2 / loud)
    )
    best = int(gain.argmax())
    delta = (sums @ (U @ (c / (eigenvalues + 1.0 / q[best])))).reshape(k, 3)
    return BiasWalk(what, float(gain[best]), float(alone.max()), float(q[best, 0]), delta, t)
