"""The filters in plain NumPy, one step at a time: slow and short. The kernel's tests compare with them.

Derivatives are those of complex steps: each filter runs for theta + i STEP e_k, for all parameters k at once, and the
imaginary part of what it gives, divided by STEP, is exact to the last digits. No derivative is written down.

The exact filter first; then the hand's in the body frame, whose x = (s, p, v, a) (12,) and P (12, 12) are those of
kernel/hand.hpp.
"""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_lyapunov

from mpucal.calibration.likelihood import Evaluation
from mpucal.calibration.parameters import HAND, NAMES, PLACES, TABLE, Form
from mpucal.calibration.problem import Problem
from mpucal.calibration.rotation import tangents
from mpucal.calibration.theta import Theta, from_elements
from mpucal.data import Vector

STEP = 1e-30
Complex = NDArray[np.complex128]
LONGEST_STEP_S = 0.2


def with_steps(theta: Theta, p: int) -> SimpleNamespace:
    """Return the fields of theta with p + 1 rows each: a complex step of each of p parameters, and theta itself."""
    steps, found = 1j * STEP * np.eye(p + 1, len(NAMES)), {}
    steps[p] = 0.0
    for row in TABLE:
        value, d = getattr(theta, row.field), steps[:, PLACES[row.name]]
        if row.form is Form.DIRECTION:
            found[row.field] = value + d @ np.array(tangents(value))
        elif row.form is Form.SYMMETRIC:
            found[row.field] = value + np.array([from_elements(row.form, each) for each in d])
        else:
            found[row.field] = value + d.reshape(p + 1, *np.shape(value))
    return SimpleNamespace(**found)


def times(M: Complex | Vector, v: Complex | Vector) -> Complex:
    """Return the product of each matrix (..., 3, 3) with its vector (..., 3)."""
    return np.asarray((M @ v[..., None])[..., 0])


def cross(v: Any) -> Any:
    """Return [v]x: (..., 3) -> (..., 3, 3)."""
    return np.cross(np.eye(3), v[..., None, :])


def rotation(phi: Any) -> Any:
    """Return exp([phi]x): (..., 3) -> (..., 3, 3), by Rodrigues' formula."""
    X, angle = cross(phi), np.sqrt((phi * phi).sum(-1))[..., None, None] / np.pi
    return np.asarray(np.eye(3) + np.sinc(angle) * X + 0.5 * np.sinc(0.5 * angle) ** 2 * (X @ X))


def of_length(v: Complex, length: float) -> Complex:
    """Return vectors (..., 3) along v; the norm is that of complex steps, without a conjugate."""
    return np.asarray(length * v / np.sqrt((v * v).sum(-1, keepdims=True)))


def evaluate_reference(problem: Problem, theta: Theta, parameters: int) -> Evaluation:
    """Evaluate as likelihood.evaluate does, by the exact filter."""
    p, series, flat, g, at = parameters, problem.series, problem.flat, problem.gravity, with_steps(theta, parameters)
    D, Dt = at.D, np.swapaxes(at.D, 1, 2)
    s, P = g * at.u, np.zeros((p + 1, 3, 3), complex)
    V, squares, gradient, fisher = 0.0, 0.0, np.zeros(p), np.zeros((p, p))
    for i in range(-1, len(series)):
        y, R = flat.y, np.diag(flat.Sigma_a / flat.worth)
        if i >= 0:
            y, R = series.y[i], _at(series.r_scale, i, 1.0) * np.diag(flat.Sigma_a)
            dt = series.dt[i]
            F = rotation(-dt * times(at.K, series.omega[i] - at.b_omega))
            c = np.diag(dt**2 * _at(series.q_scale, i, 1.0) * flat.Sigma_omega + _at(series.q_extra, i, 0.0))
            s = times(F, s)
            P = F @ P @ np.swapaxes(F, 1, 2) + cross(s) @ c @ np.swapaxes(cross(s), 1, 2)
        e, S = y - times(D, s) - at.b_a, D @ P @ Dt + R
        Si = np.linalg.inv(S)
        square = (e * times(Si, e)).sum(-1)
        cost = 0.5 * (square + np.log(np.linalg.det(S)))
        V, squares = V + cost[p].real, squares + (square[p].real if i >= 0 else 0.0)
        gradient += cost[:p].imag / STEP
        de, SidS = e[:p].imag / STEP, Si[p].real @ (S[:p].imag / STEP)
        fisher += de @ Si[p].real @ de.T
        if (i + 1) % 4 == 0:  # small and slow: every fourth stands for four
            fisher += 4 * 0.5 * np.einsum("pab,qba->pq", SidS, SidS)
        A = P @ Dt
        s, P = of_length(s + times(A @ Si, e), g), P - A @ Si @ np.swapaxes(A, 1, 2)
    return Evaluation(V, squares, gradient, fisher)


class Gain(NamedTuple):
    """The decisions of a measurement by P and e: the gain K (12, 3), S^-1 (3, 3) and the weight w."""

    K: Vector
    Si: Vector
    w: float


class Pass:
    """x (p + 1, 12) with complex steps, and P (12, 12), on their way through the samples; gains may be given."""

    def __init__(self, problem: Problem, theta: Theta, held: list[Gain] | None = None) -> None:
        self.problem, self.theta, self.held = problem, theta, held
        self.at = with_steps(theta, HAND)
        self.gains: list[Gain] = []
        self.innovations: list[Vector] = []
        self.V, self.squares = 0.0, 0.0
        self.gradient, self.fisher = np.zeros(HAND), np.zeros((HAND, HAND))
        self.x: Complex = np.zeros((HAND + 1, 12), complex)
        self.P: Vector = np.zeros((12, 12))
        self.x[:, :3] = problem.gravity * self.at.u
        self._run()

    def _run(self) -> None:
        series, flat, zero = self.problem.series, self.problem.flat, np.zeros(3)
        self._measure(flat.y, flat.Sigma_a / flat.worth, zero, zero, 0.0 * self.at.tau, np.inf)
        self.squares = 0.0
        for i in range(len(series)):
            self._turn(i)
            self._travel(i)
            if series.reset is not None and series.reset[i] >= 0.0:
                self._reset(series.reset[i])
            scale, extra = _at(series.r_scale, i, 1.0), _at(series.r_extra, i, 0.0)
            rate = zero if series.rate is None else series.rate[i]
            alpha = zero if series.alpha is None else series.alpha[i]
            self._measure(series.y[i], scale * flat.Sigma_a + extra, rate, alpha, self.at.tau, self.problem.huber)

    def _turn(self, i: int) -> None:
        """Turn all four vectors by F, and add the gyroscope's noise to s."""
        series, at, dt = self.problem.series, self.at, self.problem.series.dt[i]
        F = rotation(-dt * times(at.K, series.omega[i] - at.b_omega))
        self.x = (self.x.reshape(-1, 4, 3) @ np.swapaxes(F, 1, 2)).reshape(-1, 12)
        c = dt**2 * _at(series.q_scale, i, 1.0) * self.problem.flat.Sigma_omega + _at(series.q_extra, i, 0.0)
        s, turn = cross(self.x[-1, :3].real), np.kron(np.eye(4), F[-1].real)
        self.P = np.asarray(turn @ self.P @ turn.T)
        self.P[:3, :3] += s @ np.diag(c) @ s.T

    def _travel(self, i: int) -> None:
        """Move (p, v, a) along the chain; Phi and Q from one matrix exponential (Van Loan 1978)."""
        A, h = self._chain(), min(self.problem.series.dt[i], LONGEST_STEP_S)
        both = expm(h * np.block([[-A, np.diag([0.0, 0.0, 1.0])], [np.zeros((3, 3)), A.T]]))
        Phi: Vector = np.eye(4)
        Q: Vector = np.zeros((4, 4))
        Phi[1:, 1:] = both[3:, 3:].T
        Q[1:, 1:] = _at(self.problem.series.jerk, i, 0.0) * Phi[1:, 1:] @ both[:3, 3:]
        Phi, Q = (np.asarray(np.kron(M, np.eye(3)), float) for M in (Phi, Q))
        self.x, self.P = self.x @ Phi.T, Phi @ self.P @ Phi.T + Q

    def _reset(self, sigma: float) -> None:
        self.x[:, 3:], self.P[3:, :], self.P[:, 3:] = 0.0, 0.0, 0.0
        A, lam = self._chain(), self.problem.lam
        stationary = solve_continuous_lyapunov(A, -np.diag([0.0, 0.0, 16.0 * lam / 3.0 * sigma**2]))
        self.P[3:, 3:] = np.kron(stationary, np.eye(3))

    def _chain(self) -> Vector:
        """Return the matrix (3, 3) of d/dt (p, v, a)."""
        lam = self.problem.lam
        return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lam**3), -3.0 * lam**2, -3.0 * lam]])

    def _measure(self, y: Vector, R: Vector, rate: Vector, alpha: Vector, tau: Complex, huber: float) -> None:
        """Compute innovation, cost, derivatives and update; R (3,) is the diagonal of the noise."""
        at, x = self.at, self.x
        E = np.eye(3) + tau[:, None, None] * cross(rate)
        L = cross(alpha) + cross(rate) @ cross(rate)
        e = y - times(at.D, times(E, x[:, :3]) + at.r @ L.T) - x[:, 9:] - at.b_a
        H = np.hstack([self.theta.D @ E[-1].real, np.zeros((3, 6)), np.eye(3)])
        gain = self._gain(H, e[-1].real, np.diag(R), huber) if self.held is None else self.held[len(self.gains)]
        de = e[:-1].imag / STEP
        self.gains.append(gain)
        self.innovations.append(e[-1].real)
        self.gradient += gain.w * de @ gain.Si @ e[-1].real
        self.fisher += gain.w * de @ gain.Si @ de.T
        self.x = x + e @ gain.K.T
        self.P = self.P - gain.K @ H @ self.P
        self.x[:, :3] = of_length(self.x[:, :3], self.problem.gravity)

    def _gain(self, H: Vector, e: Vector, R: Vector, huber: float) -> Gain:
        S = H @ self.P @ H.T + R
        Si = np.asarray(np.linalg.inv(S))
        square = float(e @ Si @ e)
        d, w, rho = np.sqrt(square), 1.0, 0.5 * square
        if d > huber and self.problem.tail:
            w, rho = huber**2 / square, 0.5 * huber**2 + huber**2 * np.log(d / huber)
        elif d > huber:
            w, rho = huber / d, huber * d - 0.5 * huber**2
        self.squares += square
        self.V += float(rho + 0.5 * np.log(np.linalg.det(S)))
        return Gain(self.P @ H.T @ np.linalg.inv(S + R * (1.0 / w - 1.0)), Si, w)


def evaluate_hand_reference(problem: Problem, theta: Theta) -> Evaluation:
    """Evaluate all parameters as likelihood.evaluate, with twelve-state matrices and no structure used."""
    done = Pass(problem, theta)
    return Evaluation(done.V, done.squares, done.gradient, done.fisher)


def gains(problem: Problem, theta: Theta) -> list[Gain]:
    """Return what the filter decides at each measurement, the flat mean's first."""
    return Pass(problem, theta).gains


def innovations(problem: Problem, theta: Theta, held: list[Gain]) -> Vector:
    """Return innovations (n + 1, 3) [m/s^2], with the gains held: the gradient is made of their derivatives."""
    return np.array(Pass(problem, theta, held).innovations)


def _at(values: Vector | None, i: int, otherwise: float) -> float:
    return otherwise if values is None else float(values[i])
