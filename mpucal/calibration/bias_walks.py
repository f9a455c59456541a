"""Changes of the sensor while the board was turned: random walks over the parts of a recording, by likelihood.

The accelerometer's bias (a step, warming), the gyroscope's bias, or the accelerometer's mount may walk. Each part then
has three numbers delta_k beside theta, with delta_0 ~ N(0, q) and delta_k - delta_k-1 ~ N(0, q). A fourth hypothesis is
no change, but a bias that depends on which side is down, as a nonlinear sensor's does: each side has its own
delta ~ N(0, q).

To second order the parts' scores are enough. With theta eliminated and delta as sums of independent x, the quadratic
form is S + I/q, and by the eigenvalues of S the marginal likelihood of every q is a sum:

    2 log p(q)/p(0) = sum c^2 / (lambda + 1/q) - log(1 + q lambda)

Where nothing changed, c^2 / lambda is 1 on average for each eigenvector. A change is in the few slow ones; an effect
that no model has (a pivot that swings) enlarges all of them. So only a change explains a gain that is large with c^2
divided by the median of them all.
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
# Variances of a step from part to part, (m/s^2)^2, (rad/s)^2 and rad^2: powers of ten from the first to the last.
EXPONENTS: dict[What, tuple[float, float]] = {
    "accelerometer": (-8.0, -3.0),
    "gyroscope": (-11.0, -3.0),
    "mount": (-8.0, -2.0),
    "side": (-8.0, -1.0),
}
STEPS = {what: 10.0 ** np.arange(first, last + 0.1, 0.5) for what, (first, last) in EXPONENTS.items()}
# Twice the log likelihood ratio of a walk that is significant; sensors that stayed the same reach 10.
SIGNIFICANT = 20.0
# Median of the square of a normal variable; eigenvalues below this share of the largest are left out.
MEDIAN_SQUARE, UNSEEN = 0.455, 1e-9


class BiasWalk(NamedTuple):
    """Most likely random walk of one quantity.

    Attributes
    ----------
    what : quantity that changed. gain : 2 log of its likelihood ratio to no walk.
    q : variance of a step from part to part. alone : gain with c^2 of all eigenvectors divided by their median.
    delta : (k, 3) from the estimate, m/s^2, rad/s or rad.
    t : (k,) s after the flat segment, the middles of the parts; empty for sides.
    """

    what: What
    gain: float
    alone: float
    q: float
    delta: Vector
    t: Vector

    def error(self, gravity: float) -> float:
        """Return the error of readings before and after [m/s^2]; 0 if the accelerometer did not change."""
        return 0.5 * self.size * {"accelerometer": 1.0, "mount": gravity}.get(self.what, 0.0)

    @property
    def size(self) -> float:
        """Range of the quantity over the recording."""
        return float(np.linalg.norm(np.ptp(self.delta, axis=0)))

    @property
    def steepest(self) -> tuple[float, float]:
        """Times [s after the flat segment] between which it changed most."""
        at = int(np.linalg.norm(np.diff(self.delta, axis=0), axis=1).argmax())
        return float(self.t[at]), float(self.t[at + 1])

    def at(self, t: Vector) -> Vector:
        """Return (n, 3) values, interpolated linearly between the middles, from 0 where the turning begins."""
        at, delta = np.concatenate([[0.0], self.t]), np.vstack([np.zeros(3), self.delta])
        return np.stack([np.interp(t, at, column) for column in delta.T], axis=1)


def find_walk(parts: Parts, D: Vector) -> BiasWalk | None:
    """Return the most likely walk; None if none is significant, or the fit failed."""
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
    """Subtract a walk of the gyroscope's bias from the rates."""
    return replace(recording, gyr=recording.gyr - walk.at(np.maximum(recording.t - recording.t[flat.last - 1], 0.0)))


def walked_covariance(parts: Parts, D: Vector, q: float) -> Vector:
    """Return the covariance (p, p) of theta if the gyroscope's bias walks by q [(rad/s)^2] from part to part."""
    gradient, fisher = parts.grouped(parts.by_time(min(TIMES, len(parts))))
    k, B = len(gradient), _directions("gyroscope", D, len(parts.H))
    back = np.kron(np.eye(k) - np.eye(k, k=-1), np.eye(3))
    M = _block_diagonal(B.T @ fisher @ B) + back.T @ back / q
    across = (fisher @ B).transpose(1, 0, 2).reshape(-1, 3 * k)
    return inverse(parts.H - across @ np.linalg.solve(M, across.T))


def _directions(what: What, D: Vector, p: int) -> Vector:
    """Return (p, 3), the derivatives of the parameters by the three numbers."""
    B = np.zeros((p, 3))
    if what == "mount":
        B[PLACES["D"]] = (D @ cross(np.eye(3))).reshape(3, 9).T
    else:
        B[PLACES["b_omega" if what == "gyroscope" else "b_a"]] = np.eye(3)
    return B


def _block_diagonal(blocks: Vector) -> Vector:
    """Return (3 k, 3 k) with the blocks (k, 3, 3) along its diagonal."""
    k = len(blocks)
    M, at = np.zeros((k, 3, k, 3)), np.arange(k)
    M[at, :, at] = blocks
    return M.reshape(3 * k, 3 * k)


@cache
def _sums(k: int) -> Vector:
    """Return (3 k, 3 k) that gives the cumulative sums of k vectors of three numbers."""
    return np.asarray(np.kron(np.tri(k), np.eye(3)))


def _walk(what: What, parts: Parts, D: Vector, gradient: Vector, fisher: Vector, t: Vector) -> BiasWalk:
    k, B = len(gradient), _directions(what, D, len(parts.H))
    to_theta = fisher @ B  # (k, p, 3)
    S = _block_diagonal(B.T @ to_theta)
    across = to_theta.transpose(1, 0, 2).reshape(-1, 3 * k)
    # Theta follows a delta by these derivatives.
    follow = across.T @ parts.covariance
    S -= follow @ across
    # The deltas of a walk are cumulative sums of x.
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
