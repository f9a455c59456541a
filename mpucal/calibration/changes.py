"""Changes of the sensor while the board was turned, by likelihood over the parts of a recording.

Each part has three numbers delta_k beside theta. The accelerometer's bias, its scale factors or its mount may step at
any time, or drift evenly: delta_k = x w_k, with one x ~ N(0, q) and a shape w. The gyroscope's bias may walk: delta_0
and each delta_k - delta_k-1 ~ N(0, q). A last hypothesis is no change, but a bias that depends on which side is down,
as a nonlinear sensor's does: each side has its own delta ~ N(0, q).

To second order the parts' scores are enough. With theta eliminated and delta as sums of independent x, the quadratic
form is S + I/q, and by the eigenvalues of S the marginal likelihood of every q is a sum:

    2 log p(q)/p(0) = sum c^2 / (lambda + 1/q) - log(1 + q lambda)

Where nothing changed, c^2 / lambda is 1 on average for each eigenvector. A change is in a few of them; an effect that
no model has (a pivot that swings) enlarges all. So only a change explains a gain that is large with c^2 divided by the
median of them all.
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

What = Literal["accelerometer", "scale", "mount", "gyroscope", "side"]

# Stretches of time of a walk, and between which a step is sought.
WALK_TIMES, STEP_TIMES = 16, 48
# Standard deviations of a step or drift: m/s^2, 1, rad.
STEP_SD: dict[What, float] = {"accelerometer": 0.1, "scale": 0.01, "mount": 0.05}
# Variances q that are tried: (rad/s)^2 from part to part, and (m/s^2)^2.
VARIANCES: dict[What, Vector] = {
    "gyroscope": 10.0 ** np.arange(-11.0, -2.9, 0.5),
    "side": 10.0 ** np.arange(-8, -0.9, 0.5),
}
# Twice the log likelihood ratio of a change that is significant; sensors that stayed the same reach 10.
SIGNIFICANT = 20.0
# Median of the square of a normal variable; eigenvalues below this share of the largest are left out.
MEDIAN_SQUARE, UNSEEN = 0.455, 1e-9


class Change(NamedTuple):
    """Most likely change of one quantity.

    Attributes
    ----------
    what : quantity that changed. gain : 2 log of its likelihood ratio to no change.
    q : variance of x. alone : gain with c^2 of all eigenvectors divided by their median.
    delta : (k, 3) by part, m/s^2, 1, rad or rad/s.
    t : (k,) s after the flat segment, the middles of the parts; empty for sides.
    away : (p,) largest distance of the parameters from the estimate, in any part.
    """

    what: What
    gain: float
    alone: float
    q: float
    delta: Vector
    t: Vector
    away: Vector

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


def find_changes(parts: Parts, D: Vector) -> list[Change]:
    """Return the significant changes of each quantity, the most likely first; none where the fit failed."""
    if not (np.isfinite(parts.H).all() and np.isfinite(D).all()):
        return []
    by_time, middles = _by_time(parts, WALK_TIMES)
    changes = [
        _walk("gyroscope", parts, D, *by_time, middles),
        _walk("side", parts, D, *parts.grouped(parts.side), middles[:0]),
    ]
    by_time, middles = _by_time(parts, STEP_TIMES)
    changes += [_step(what, parts, D, *by_time, middles) for what in STEP_SD]
    significant = [change for change in changes if change.gain > SIGNIFICANT]
    return sorted(significant, key=lambda change: -change.gain)


def remove_walk(recording: Recording, flat: Flat, walk: Change) -> Recording:
    """Subtract a walk of the gyroscope's bias from the rates."""
    return replace(recording, gyr=recording.gyr - walk.at(np.maximum(recording.t - recording.t[flat.last - 1], 0.0)))


def walked_covariance(parts: Parts, D: Vector, q: float) -> Vector:
    """Return the covariance (p, p) of theta if the gyroscope's bias walks by q [(rad/s)^2] from part to part."""
    (gradient, fisher), _ = _by_time(parts, WALK_TIMES)
    k, B = len(gradient), _directions("gyroscope", D, len(parts.H))
    back = np.kron(np.eye(k) - np.eye(k, k=-1), np.eye(3))
    M = _block_diagonal(B.T @ fisher @ B) + back.T @ back / q
    across = (fisher @ B).transpose(1, 0, 2).reshape(-1, 3 * k)
    return inverse(parts.H - across @ np.linalg.solve(M, across.T))


def _by_time(parts: Parts, times: int) -> tuple[tuple[Vector, Vector], Vector]:
    """Return gradients and Fisher matrices of stretches of time, and their middles (k,) [s after the flat segment]."""
    groups = parts.by_time(min(times, len(parts)))
    first = np.searchsorted(groups, np.arange(groups[-1] + 1))
    last = np.append(first[1:], len(parts)) - 1
    return parts.grouped(groups), 0.5 * (parts.start[first] + parts.end[last])


def _directions(what: What, D: Vector, p: int) -> Vector:
    """Return (p, 3), the derivatives of the parameters by the three numbers."""
    B = np.zeros((p, 3))
    if what == "mount":
        B[PLACES["D"]] = (D @ cross(np.eye(3))).reshape(3, 9).T
    elif what == "scale":
        B[PLACES["D"]] = (np.eye(3)[:, :, None] * D).reshape(3, 9).T
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


def _quadratic(
    what: What, parts: Parts, D: Vector, gradient: Vector, fisher: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return S (3 k, 3 k) and c (3 k,) of delta without theta, B (p, 3), and (3 k, p) by which theta follows -delta."""
    B = _directions(what, D, len(parts.H))
    to_theta = fisher @ B  # (k, p, 3)
    across = to_theta.transpose(1, 0, 2).reshape(-1, 3 * len(gradient))
    follow = across.T @ parts.covariance
    S = _block_diagonal(B.T @ to_theta) - follow @ across
    return S, follow @ parts.left - (gradient @ B).ravel(), B, follow


def _walk(what: What, parts: Parts, D: Vector, gradient: Vector, fisher: Vector, t: Vector) -> Change:
    S, c, B, follow = _quadratic(what, parts, D, gradient, fisher)
    # The deltas of a walk are cumulative sums of x.
    sums = np.eye(len(S)) if what == "side" else _sums(len(gradient))
    eigenvalues, U = np.linalg.eigh(sums.T @ S @ sums)
    eigenvalues = np.maximum(eigenvalues, 0.0)
    c = U.T @ (sums.T @ c)
    q = VARIANCES[what][:, None]
    loud = _loudness(c, eigenvalues)
    gain, alone = (
        np.sum(square / (eigenvalues + 1.0 / q) - np.log1p(q * eigenvalues), axis=1) for square in (c**2, c**2 / loud)
    )
    best = int(gain.argmax())
    delta = (sums @ (U @ (c / (eigenvalues + 1.0 / q[best])))).reshape(-1, 3)
    return Change(what, float(gain[best]), float(alone.max()), float(q[best, 0]), delta, t, _away(delta, B, follow))


def _step(what: What, parts: Parts, D: Vector, gradient: Vector, fisher: Vector, t: Vector) -> Change:
    """Return the most likely step or even drift. All of them are equally likely before, of any kind at any time."""
    S, c, B, follow = _quadratic(what, parts, D, gradient, fisher)
    k, q = len(gradient), STEP_SD[what] ** 2
    shapes = np.vstack([np.tri(k).T[1:], t / t[-1]])
    own = np.einsum("mi,iajb,mj->mab", shapes, S.reshape(k, 3, k, 3), shapes, optimize=True) + np.eye(3) / q
    of_shapes = shapes @ c.reshape(k, 3)
    x = np.linalg.solve(own, of_shapes[:, :, None])[:, :, 0]
    chi2 = np.sum(x * of_shapes, axis=1)
    at = int(chi2.argmax())
    tries = 2.0 * np.log(len(STEP_SD) * len(shapes))
    gain = alone = float(chi2[at]) - tries
    if gain > SIGNIFICANT:  # what the step leaves shows how loud chance is
        across = S @ np.kron(shapes[at][:, None], np.eye(3))
        sums = _sums(k)
        eigenvalues, U = np.linalg.eigh(sums.T @ (S - across @ np.linalg.solve(own[at], across.T)) @ sums)
        alone = float(chi2[at]) / _loudness(U.T @ sums.T @ (c - across @ x[at]), np.maximum(eigenvalues, 0.0)) - tries
    delta = np.outer(shapes[at], x[at])
    return Change(what, gain, alone, q, delta, t, _away(delta, B, follow))


def _loudness(c: Vector, eigenvalues: Vector) -> float:
    """Return the median of c^2 / lambda as a multiple of what chance gives, 1 or more."""
    seen = eigenvalues > UNSEEN * eigenvalues[-1]
    return max(float(np.median(c[seen] ** 2 / eigenvalues[seen])) / MEDIAN_SQUARE, 1.0)


def _away(delta: Vector, B: Vector, follow: Vector) -> Vector:
    """Return (p,) the largest distance of theta from the estimate, before the first part and in any."""
    return np.asarray(np.abs(np.vstack([np.zeros(3), delta]) @ B.T - delta.ravel() @ follow).max(axis=0))
