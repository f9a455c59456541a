"""First estimate of D and b_a without iteration: linear least squares for each direction gravity may start in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Vector
from ..kernel import _kernel
from ..rests.intervals import true_runs
from .hand_noise import FIRST_MPS2
from .likelihood import evaluate
from .masks import GAP_ANGLE_VARIANCE, LOST_RAD
from .problem import Problem, Series
from .rotation import fibonacci_sphere, tangents
from .scores import FEWEST_SAMPLES
from .theta import Theta

REFINEMENTS = 3
# The ridge keeps the equations solvable for a board that hardly turned; a second of data outweighs it.
RIDGE = 1e-9
STRETCHES = 4  # this many of the longest stretches between gaps are tried


def initialise(problem: Problem, b_omega: Vector) -> Theta:
    """Fit D, b_a and the starting direction u of y_t = D g C_t u + b_a by least squares, det D > 0.

    C_t turns the first body frame into the frame at t, by the gyro alone. The residual depends on the data only
    through sums of C_t's products, so a search over the whole sphere costs as much as one sample.
    (u, D) and (-u, -D) fit equally well: det D > 0 decides.

    A gap in which the board turned breaks C_t: with gaps, the stretches between them and a perfect sensor are tried as
    well, and the filter, which allows for the unknown turn across a gap, decides which estimate is best.

    Parameters
    ----------
    b_omega : (3,) rad/s, the gyroscope's bias of the flat segment.
    """
    whole = _between_gaps(problem, slice(0, len(problem.series)), b_omega)
    stretches = _stretches(problem.series)
    if not stretches:
        return whole
    rough = [_from_the_flat_mean(problem, _between_gaps(problem, part, b_omega)) for part in stretches]
    return min([whole, perfect(problem, b_omega), *rough], key=lambda theta: _misfit(problem, theta))


def perfect(problem: Problem, b_omega: Vector) -> Theta:
    """Return a perfect sensor in the orientation of the flat segment."""
    return _from_the_flat_mean(problem, Theta.start(np.eye(3), np.zeros(3), b_omega, np.array([0.0, 0.0, 1.0])))


def _between_gaps(problem: Problem, part: slice, b_omega: Vector) -> Theta:
    """Return the estimate from a part of the series alone; u is gravity's direction before its first step."""
    series = problem.series
    r_scale = None if series.r_scale is None else series.r_scale[part]
    CC, yC, C, y, _, n = _kernel.moments(
        np.ascontiguousarray(b_omega), series.y[part], series.omega[part], series.dt[part], r_scale
    )
    sums = _Sums(CC, yC, C.reshape(3, 3), y, n, problem)
    points = fibonacci_sphere()
    u = points[int(np.argmin(sums.cost(points)))]
    u = _refine(u, sums, step=2.0 / np.sqrt(len(points)))
    D, b_a = sums.solve(u[None])
    sign = 1.0 if np.linalg.det(D[0]) > 0 else -1.0
    return Theta.start(sign * D[0], b_a[0], b_omega, sign * u)


def _stretches(series: Series) -> list[slice]:
    """Return the longest parts of the series between gaps with an unknown turn; none without gaps."""
    if series.q_extra is None:
        return []
    lost = series.q_extra >= 0.9 * GAP_ANGLE_VARIANCE * series.dt
    gaps = [(a, b) for a, b in true_runs(lost).tolist() if series.q_extra[a:b].sum() > LOST_RAD**2]
    if not gaps:
        return []
    starts, ends = [0, *(b for _, b in gaps)], [*(a for a, _ in gaps), len(series)]
    longest = sorted(zip(starts, ends, strict=True), key=lambda part: part[0] - part[1])[:STRETCHES]
    return [slice(a, b) for a, b in longest if b - a >= FEWEST_SAMPLES]


def _from_the_flat_mean(problem: Problem, theta: Theta) -> Theta:
    """Return theta with the u that D, b_a and the flat mean give."""
    s = np.linalg.lstsq(theta.D, problem.flat.y - theta.b_a, rcond=None)[0]
    length = float(np.linalg.norm(s))
    # A dead accelerometer has a D of zeros, which gives no direction.
    return replace(theta, u=np.asarray(s / length)) if length > 1e-9 else theta


def _misfit(problem: Problem, theta: Theta) -> float:
    """Return V of the exact filter, with noise enough for a hand and for an error of the gyroscope's scale."""
    of = problem.series
    series = Series(of.y, of.omega, of.dt, of.r_scale, of.q_scale, of.q_extra)
    flat = replace(problem.flat, Sigma_a=problem.flat.Sigma_a + FIRST_MPS2**2)
    V = evaluate(Problem(series, flat, problem.gravity), theta, 0).V
    return V if np.isfinite(V) else np.inf


class _Sums:
    """Normal equations of (D, b_a) for any u, from sums over the recording."""

    def __init__(self, CC: Vector, yC: Vector, C: Vector, y: Vector, n: float, problem: Problem) -> None:
        # In this order a product with u, or with all products of u's elements, gives the sums for that u.
        self.CC = CC.reshape(3, 3, 3, 3).transpose(1, 3, 0, 2).reshape(9, 9)
        self.yC = yC.reshape(3, 3, 3).transpose(2, 1, 0).reshape(3, 9)
        self.C, self.y, self.n = C, y, n
        self.g, self.Sigma_a = problem.gravity, problem.flat.Sigma_a

    def _equations(self, u: Vector) -> tuple[Vector, Vector]:
        """Return sums of z z' (m, 4, 4) and z y' (m, 4, 3), z = (g C_t u, 1), for u (m, 3)."""
        m, g = len(u), self.g
        zz, zy = np.empty((m, 4, 4)), np.empty((m, 4, 3))
        zz[:, :3, :3] = g * g * ((u[:, :, None] * u[:, None, :]).reshape(m, 9) @ self.CC).reshape(m, 3, 3)
        zz[:, :3, 3] = zz[:, 3, :3] = g * u @ self.C.T
        zz[:, 3, 3] = self.n
        zy[:, :3] = g * (u @ self.yC).reshape(m, 3, 3)
        zy[:, 3] = self.y
        zz += RIDGE * np.trace(zz, axis1=1, axis2=2)[:, None, None] * np.eye(4)
        return zz, zy

    def solve(self, u: Vector) -> tuple[Vector, Vector]:
        """Return D (m, 3, 3) and b_a (m, 3) for u (m, 3)."""
        solution = np.swapaxes(np.linalg.solve(*self._equations(u)), 1, 2)
        return solution[:, :, :3], solution[:, :, 3]

    def cost(self, u: Vector) -> Vector:
        """Return residual sums of squares (m,) in units of Sigma_a, up to a constant."""
        zz, zy = self._equations(u)
        return np.asarray(-(zy * np.linalg.solve(zz, zy)).sum(1) @ (1.0 / self.Sigma_a))


def _refine(u: Vector, sums: _Sums, step: float) -> Vector:
    """Refine u by Newton's method on the sphere, with differences; each round takes smaller ones."""
    grid = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]], float)
    for _ in range(REFINEMENTS):
        across = np.stack(tangents(u))
        points = u + step * grid @ across
        V = sums.cost(points / np.linalg.norm(points, axis=1, keepdims=True))
        gradient = np.array([V[1] - V[2], V[3] - V[4]]) / 2.0
        cross = (V[5] + V[6] - V[1] - V[2] - V[3] - V[4]) / 2.0 + V[0]
        hessian = np.array([[V[1] + V[2] - 2 * V[0], cross], [cross, V[3] + V[4] - 2 * V[0]]])
        best = points[int(np.argmin(V))]
        if hessian[0, 0] > 0 and np.linalg.det(hessian) > 0:
            newton = u - step * np.linalg.solve(hessian, gradient) @ across
            newton /= np.linalg.norm(newton)
            if sums.cost(newton[None])[0] <= V.min():
                best = newton
        step *= 0.3
        u = best / np.linalg.norm(best)
    return u
