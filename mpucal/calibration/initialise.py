"""A first estimate of D and b_a without iteration: linear least squares for every direction gravity may start in."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from ..kernel import _kernel
from .likelihood import Problem, Theta
from .model import tangents

POINTS = 300
REFINEMENTS = 5
# keeps the equations solvable for a board that hardly turned; nothing beside a second of data
RIDGE = 1e-9


def initialise(problem: Problem, b_omega: Vector) -> Theta:
    """The D, b_a and starting direction u that fit y_t = D g C_t u + b_a best, det D > 0.

    C_t turns the first body frame into the frame at t, by the gyro alone. The residual depends on the data only
    through sums of C_t's products, so a search over the whole sphere costs as much as one sample.
    (u, D) and (-u, -D) fit equally well: det D > 0 decides.

    Parameters
    ----------
    b_omega : (3,) rad/s, the gyroscope's bias of the flat segment.
    """
    series = problem.series
    CC, yC, C, y, _, n = _kernel.moments(
        np.ascontiguousarray(b_omega), series.y, series.omega, series.dt, series.r_scale
    )
    sums = _Sums(CC, yC, C.reshape(3, 3), y, n, problem)
    points = fibonacci_sphere(POINTS)
    u = points[int(np.argmin(sums.cost(points)))]
    u = _refine(u, sums, step=2.0 / np.sqrt(POINTS))
    D, b_a = sums.solve(u[None])
    sign = 1.0 if np.linalg.det(D[0]) > 0 else -1.0
    return Theta.start(sign * D[0], b_a[0], b_omega, sign * u)


def fibonacci_sphere(n: int) -> Vector:
    """(n, 3) unit vectors spread evenly over the sphere."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


class _Sums:
    """The normal equations of (D, b_a) for any u, from sums over the recording."""

    def __init__(self, CC: Vector, yC: Vector, C: Vector, y: Vector, n: float, problem: Problem) -> None:
        # ordered so that a product with u, or with all products of u's elements, gives the sums for that u
        self.CC = CC.reshape(3, 3, 3, 3).transpose(1, 3, 0, 2).reshape(9, 9)
        self.yC = yC.reshape(3, 3, 3).transpose(2, 1, 0).reshape(3, 9)
        self.C, self.y, self.n = C, y, n
        self.g, self.Sigma_a = problem.gravity, problem.flat.Sigma_a

    def _equations(self, u: Vector) -> tuple[Vector, Vector]:
        """(m, 4, 4) and (m, 4, 3): sums of z z' and z y', z = (g C_t u, 1), for u (m, 3)."""
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
        """D (m, 3, 3) and b_a (m, 3) for u (m, 3)."""
        solution = np.swapaxes(np.linalg.solve(*self._equations(u)), 1, 2)
        return solution[:, :, :3], solution[:, :, 3]

    def cost(self, u: Vector) -> Vector:
        """(m,) residual sum of squares in units of Sigma_a, up to a constant."""
        zz, zy = self._equations(u)
        return np.asarray(-(zy * np.linalg.solve(zz, zy)).sum(1) @ (1.0 / self.Sigma_a))


def _refine(u: Vector, sums: _Sums, step: float) -> Vector:
    """Newton's method on the sphere by differences; a step that does not help halves the distance instead."""
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
