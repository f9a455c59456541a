"""The paper's quaternion EKF, for many parameter sets in one pass.

Olsson, Kok, Halvorsen, Schön (2016), equations (1) to (3) and (6); quaternions (4,) are scalar first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat

# x_0 comes from the uncalibrated mean, which misalignment and a bias of 1 m/s^2 tilt by about 10 deg.
P_0_RAD = np.radians(10.0)

# The innovations of this many samples are held at a time, which bounds the memory for a long recording.
BLOCK = 4096


def gravity_jacobian(x: Vector) -> Vector:
    """Return J of R(x) g = |g| J x / 2 and d(R(x) g)/dx = |g| J, for g upwards; (..., 4) -> (..., 3, 4)."""
    J: Vector = (x @ _J).reshape(*x.shape[:-1], 3, 4)
    return J


def product(r: Vector) -> Vector:
    """Return F of x (*) r = F x, the product of equation (1); (..., 4) -> (..., 4, 4)."""
    F: Vector = (r @ _F).reshape(*r.shape[:-1], 4, 4)
    return F


def turning(x: Vector) -> Vector:
    """Return Xi of x (*) (0, v) = Xi v; (..., 4) -> (..., 4, 3)."""
    Xi: Vector = (x @ _XI).reshape(*x.shape[:-1], 4, 3)
    return Xi


def exponential(v: Vector) -> Vector:
    """Return exp v of equation (1), v half a rotation vector [rad]; (..., 3) -> (..., 4)."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * v], axis=-1)


def specific_force(x: Vector, gravity: float) -> Vector:
    """Return R(x) g of equation (3), g upwards; (..., 4) -> (..., 3) m/s^2."""
    s: Vector = 0.5 * gravity * (gravity_jacobian(x) @ x[..., None])[..., 0]
    return s


def orientation_of(y: Vector) -> Vector:
    """Return the x of least rotation with R(x) g along y, (3,) -> (4,): the direction of y does not give yaw."""
    u = y / np.linalg.norm(y)
    # The half-way quaternion between e_z and u vanishes where they are opposite.
    if u[2] < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    x = np.array([1.0 + u[2], u[1], -u[0], 0.0])
    return _unit(x)


def inverse(S: Vector) -> tuple[Vector, Vector]:
    """Return inverses (..., 3, 3) and determinants (...) of symmetric S (..., 3, 3).

    By cofactors, three times faster than LAPACK at this size; a singular S gives infinities, not an exception.
    """
    x, y, z = np.moveaxis(S, -2, 0)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-2)
    determinant = np.sum(x * cofactors[..., 0, :], axis=-1)
    return cofactors / determinant[..., None, None], determinant


@dataclass(frozen=True)
class Innovations:
    """Innovations of the EKF in a block of t samples under b parameter sets.

    Attributes
    ----------
    e : (t, b, 3) m/s^2, y_t - y-hat_{t|t-1}. S : (t, b, 3, 3), its covariance (6).
    x : (t, b, 4), the orientation after y_t.
    """

    e: Vector
    S: Vector
    x: Vector


@dataclass(frozen=True)
class Ekf:
    """State space model (1)-(3) of a recording, without theta = {D, b_a}.

    Attributes
    ----------
    y : (n, 3) m/s^2. F : (n, 4, 4), x_{t+1} = F_t x_t. sigma_phi : (n, 3) rad, sd of half the angle that v_t turns.
    Sigma_a : (3, 3). x_0 : (4,). P_0 : (4, 4). gravity : m/s^2.
    """

    y: Vector
    F: Vector
    sigma_phi: Vector
    Sigma_a: Vector
    x_0: Vector
    P_0: Vector
    gravity: float

    @classmethod
    def after(cls, flat: Flat, recording: Recording, gravity: float, P_0_rad: float = P_0_RAD) -> Self:
        """Build the filter over the samples that follow the flat segment."""
        y, gyr = recording.acc[flat.last :], recording.gyr[flat.last :]
        delta = np.diff(recording.t[flat.last :], append=recording.t[-1])
        x_0 = orientation_of(flat.y)
        Xi = turning(x_0)
        return cls(
            y,
            F=product(exponential(0.5 * delta[:, None] * (gyr - flat.b_omega))),  # (1), (2)
            sigma_phi=0.5 * delta[:, None] * np.sqrt(flat.Sigma_omega),
            Sigma_a=np.diag(flat.Sigma_a),
            x_0=x_0,
            P_0=(0.5 * P_0_rad) ** 2 * Xi @ Xi.T,
            gravity=gravity,
        )

    def run(self, D: Vector, b_a: Vector) -> Iterator[Innovations]:
        """Yield the one-step-ahead predictors (6) of every sample, in blocks.

        Parameters
        ----------
        D : (b, 3, 3) and b_a : (b, 3) m/s^2, b parameter sets.
        """
        g_D = self.gravity * D
        x = np.tile(self.x_0, (len(D), 1))
        P = np.tile(self.P_0, (len(D), 1, 1))
        for start in range(0, len(self.y), BLOCK):
            block = range(start, min(start + BLOCK, len(self.y)))
            e_s, S_s, x_s = [], [], []
            for t in block:
                x, P, e, S = self.correct(x, P, self.y[t] - b_a, g_D)
                e_s.append(e)
                S_s.append(S)
                x_s.append(x)
                x, P = self.predict(x, P, t)
            yield Innovations(np.array(e_s), np.array(S_s), np.array(x_s))

    def correct(self, x: Vector, P: Vector, y_less_b: Vector, g_D: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Return x, P of t|t and e, S of (6), (b, 4), (b, 4, 4), (b, 3), (b, 3, 3), from y - b_a and |g| D."""
        H = g_D @ gravity_jacobian(x)
        e = y_less_b - 0.5 * (H @ x[..., None])[..., 0]
        H_P = H @ P
        S = H_P @ _transposed(H) + self.Sigma_a
        gain = _transposed(H_P) @ inverse(S)[0]
        x = x + (gain @ e[..., None])[..., 0]
        return _unit(x), P - gain @ H_P, e, S

    def predict(self, x: Vector, P: Vector, t: int) -> tuple[Vector, Vector]:
        """Return x and P of t+1|t. P loses its part along x, which the normalisation of x removes."""
        following = x @ self.F[t].T
        N = self.F[t] - following[..., :, None] * x[..., None, :]
        G = turning(following) * self.sigma_phi[t]
        return following, N @ P @ _transposed(N) + G @ _transposed(G)


def _unit(x: Vector) -> Vector:
    unit: Vector = x / np.sqrt((x * x).sum(-1, keepdims=True))
    return unit


def _transposed(matrices: Vector) -> Vector:
    # It is copied, since matmul is three times slower on a transposed view of small matrices.
    return np.ascontiguousarray(np.swapaxes(matrices, -1, -2))


def _linear(matrix: Callable[..., list[list[float]]]) -> Vector:
    """Return T with x @ T = matrix(*x), flattened, for a matrix that is linear in the quaternion x."""
    return np.array([matrix(*e) for e in np.eye(4)]).reshape(4, -1)


_J = 2.0 * _linear(lambda a, b, c, d: [[-c, d, -a, b], [b, a, d, c], [a, -b, -c, d]])
_F = _linear(lambda a, b, c, d: [[a, -b, -c, -d], [b, a, d, -c], [c, -d, a, b], [d, c, -b, a]])
_XI = _linear(lambda a, b, c, d: [[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]])
