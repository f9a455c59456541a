"""The filters in plain NumPy, a step at a time: slow, short, and the oracle of the kernel's tests.

The exact filter first; then the hand's in the body frame, whose x = (s, p, v, a) (12,) and P (12, 12) are those of
kernel/hand.hpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from mpucal.calibration.likelihood import Evaluation
from mpucal.calibration.parameters import ACCEL, HAND, PLACES
from mpucal.calibration.problem import Problem
from mpucal.calibration.rotation import cross, rotation, tangents
from mpucal.calibration.theta import Theta
from mpucal.data import Vector

K_BASIS = np.zeros((6, 3, 3))
for _m, (_i, _j) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
    K_BASIS[_m, _i, _j] = K_BASIS[_m, _j, _i] = 1.0


def left_jacobian(phi: Vector) -> Vector:
    """Return J_l of d exp([phi]x) = [J_l dphi]x exp([phi]x).

    Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics" (2018), appendix B.
    """
    angle = float(np.linalg.norm(phi))
    X = cross(phi)
    if angle < 1e-3:
        return np.eye(3) + X / 2 + X @ X / 6
    return np.asarray(np.eye(3) + (1 - np.cos(angle)) / angle**2 * X + (angle - np.sin(angle)) / angle**3 * (X @ X))


class _State(NamedTuple):
    """s, P and their derivatives by the p parameters, (p, 3) and (p, 3, 3)."""

    s: Vector
    P: Vector
    ds: Vector
    dP: Vector


class _Sums:
    """Sums of a pass."""

    def __init__(self, p: int) -> None:
        self.V, self.squares, self.measurements = 0.0, 0.0, 0
        self.gradient, self.fisher = np.zeros(p), np.zeros((p, p))


def evaluate_reference(problem: Problem, theta: Theta, parameters: int) -> Evaluation:
    """Evaluate as likelihood.evaluate does, derived term by term (matrix calculus, no structure used)."""
    p, series, flat, g = parameters, problem.series, problem.flat, problem.gravity
    sums = _Sums(p)
    ds = np.zeros((p, 3))
    if p:
        ds[PLACES["tilt"]] = [g * t for t in tangents(theta.u)]
    state = _State(g * theta.u, np.zeros((3, 3)), ds, np.zeros((p, 3, 3)))
    state = _measure(state, flat.y, flat.Sigma_a / flat.worth, theta, g, sums)
    sums.squares = 0.0
    for i in range(len(series)):
        state = _propagate(state, problem, theta, i)
        scale = 1.0 if series.r_scale is None else series.r_scale[i]
        state = _measure(state, series.y[i], scale * flat.Sigma_a, theta, g, sums)
    return Evaluation(sums.V, sums.squares, sums.gradient, sums.fisher)


def _directions(p: int) -> tuple[Vector, Vector]:
    """Return derivatives of D (p, 3, 3) and b_a (p, 3) by the parameters."""
    dD, db = np.zeros((p, 3, 3)), np.zeros((p, 3))
    if p:
        dD[PLACES["D"]] = np.eye(9).reshape(9, 3, 3)
        db[PLACES["b_a"]] = np.eye(3)
    return dD, db


def _measure(state: _State, y: Vector, R: Vector, theta: Theta, g: float, sums: _Sums) -> _State:
    """Compute innovation, cost and update; R (3,) is Sigma_a of this sample."""
    s, P, ds, dP = state
    D, p = theta.D, len(ds)
    dD, db = _directions(p)
    e = y - D @ s - theta.b_a
    de = -(dD @ s) - ds @ D.T - db
    S = D @ P @ D.T + np.diag(R)
    dS = dD @ P @ D.T + D @ dP @ D.T + D @ P @ np.swapaxes(dD, 1, 2)
    Si = np.linalg.inv(S)
    square = float(e @ Si @ e)
    dsquare = 2.0 * de @ Si @ e - np.einsum("a,pab,b->p", Si @ e, dS, Si @ e)
    SidS = Si @ dS
    sums.squares += square
    sums.V += 0.5 * square + 0.5 * float(np.log(np.linalg.det(S)))
    sums.gradient += 0.5 * dsquare + 0.5 * np.trace(SidS, axis1=1, axis2=2)
    sums.fisher += de @ Si @ de.T
    if sums.measurements % 4 == 0:  # small and slow: every fourth stands for four
        sums.fisher += 4 * 0.5 * np.einsum("pab,qba->pq", SidS, SidS)
    sums.measurements += 1
    A = P @ D.T
    dA = dP @ D.T + P @ np.swapaxes(dD, 1, 2)
    gain, dgain = A @ Si, dA @ Si - A @ Si @ dS @ Si
    plus, dplus = s + gain @ e, ds + dgain @ e + de @ gain.T
    P, dP = P - gain @ A.T, dP - dgain @ A.T - gain @ np.swapaxes(dA, 1, 2)
    norm = float(np.linalg.norm(plus))
    unit = plus / norm
    return _State(g * unit, P, g / norm * (dplus - (dplus @ unit)[:, None] * unit), dP)


def _propagate(state: _State, problem: Problem, theta: Theta, i: int) -> _State:
    """Carry s and P through the turn of step i."""
    s, P, ds, dP = state
    series, p = problem.series, len(ds)
    dt, rate = series.dt[i], series.omega[i] - theta.b_omega
    phi = -dt * theta.K @ rate
    F = rotation(phi)
    dphi = np.zeros((p, 3))
    if p:
        dphi[PLACES["b_omega"]] = dt * theta.K.T
    if p > ACCEL:
        dphi[PLACES["K"]] = -dt * K_BASIS @ rate
    eta = dphi @ left_jacobian(phi).T
    dF = cross(eta) @ F
    turned, dturned = F @ s, ds @ F.T + dF @ s
    Fp = F @ P @ F.T
    dFp = F @ dP @ F.T + dF @ P @ F.T + F @ P @ np.swapaxes(dF, 1, 2)
    q_scale = 1.0 if series.q_scale is None else series.q_scale[i]
    q_extra = 0.0 if series.q_extra is None else series.q_extra[i]
    c = np.diag(dt**2 * q_scale * problem.flat.Sigma_omega + q_extra)
    X, dX = cross(turned), cross(dturned)
    half = dX @ c @ X.T
    return _State(turned, Fp + X @ c @ X.T, dturned, dFp + half + np.swapaxes(half, 1, 2))


LONGEST_STEP_S, SPEED_OF_RESET_S = 0.2, 0.04


class Gain(NamedTuple):
    """The decisions of a measurement by P and e: the gain K (12, 3), S^-1 (3, 3) and the weight w."""

    K: Vector
    Si: Vector
    w: float


class Pass:
    """x = (s, p, v, a) (12,), P (12, 12) and dx (p, 12) on their way through the samples; gains may be given."""

    def __init__(self, problem: Problem, theta: Theta, held: list[Gain] | None = None) -> None:
        self.problem, self.theta, self.held = problem, theta, held
        self.gains: list[Gain] = []
        self.innovations: list[Vector] = []
        self.V, self.squares = 0.0, 0.0
        self.gradient, self.fisher = np.zeros(HAND), np.zeros((HAND, HAND))
        self.x: Vector = np.zeros(12)
        self.P: Vector = np.zeros((12, 12))
        self.dx: Vector = np.zeros((HAND, 12))
        self.x[:3] = problem.gravity * theta.u
        self.dx[PLACES["tilt"], :3] = [problem.gravity * t for t in tangents(theta.u)]
        self._run()

    def _run(self) -> None:
        series, flat, zero = self.problem.series, self.problem.flat, np.zeros(3)
        self._measure(flat.y, flat.Sigma_a / flat.worth, zero, zero, 0.0, np.inf)
        self.squares = 0.0
        for i in range(len(series)):
            self._turn(i)
            self._travel(i)
            if series.reset is not None and series.reset[i] >= 0.0:
                self._reset(series.reset[i])
            scale, extra = _at(series.r_scale, i, 1.0), _at(series.r_extra, i, 0.0)
            rate = zero if series.rate is None else series.rate[i]
            alpha = zero if series.alpha is None else series.alpha[i]
            self._measure(series.y[i], scale * flat.Sigma_a + extra, rate, alpha, self.theta.tau, self.problem.huber)

    def _turn(self, i: int) -> None:
        """Turn all four vectors by F, and add the gyroscope's noise to s."""
        series, theta = self.problem.series, self.theta
        dt, rate = series.dt[i], series.omega[i] - theta.b_omega
        phi = -dt * theta.K @ rate
        dphi = np.zeros((HAND, 3))
        dphi[PLACES["b_omega"]], dphi[PLACES["K"]] = dt * theta.K.T, -dt * K_BASIS @ rate
        F = np.kron(np.eye(4), rotation(phi))
        dF = np.kron(np.eye(4), cross(dphi @ left_jacobian(phi).T)) @ F
        self.x, self.dx = F @ self.x, self.dx @ F.T + dF @ self.x
        c = dt**2 * _at(series.q_scale, i, 1.0) * self.problem.flat.Sigma_omega + _at(series.q_extra, i, 0.0)
        s = cross(self.x[:3])
        self.P = np.asarray(F @ self.P @ F.T)
        self.P[:3, :3] += s @ np.diag(c) @ s.T

    def _travel(self, i: int) -> None:
        """Move (p, v, a) along the chain; Phi and Q from one matrix exponential (Van Loan 1978)."""
        lam, h = self.problem.lam, min(self.problem.series.dt[i], LONGEST_STEP_S)
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lam**3), -3.0 * lam**2, -3.0 * lam]])
        both = expm(h * np.block([[-A, np.diag([0.0, 0.0, 1.0])], [np.zeros((3, 3)), A.T]]))
        Phi: Vector = np.eye(4)
        Q: Vector = np.zeros((4, 4))
        Phi[1:, 1:] = both[3:, 3:].T
        Q[1:, 1:] = _at(self.problem.series.jerk, i, 0.0) * Phi[1:, 1:] @ both[:3, 3:]
        Phi, Q = (np.asarray(np.kron(M, np.eye(3)), float) for M in (Phi, Q))
        self.x, self.dx, self.P = Phi @ self.x, self.dx @ Phi.T, Phi @ self.P @ Phi.T + Q

    def _reset(self, sigma: float) -> None:
        self.x[3:], self.dx[:, 3:], self.P[3:, :], self.P[:, 3:] = 0.0, 0.0, 0.0, 0.0
        self.P[6:9, 6:9] = (SPEED_OF_RESET_S * sigma) ** 2 * np.eye(3)
        self.P[9:, 9:] = sigma**2 * np.eye(3)

    def _measure(self, y: Vector, R: Vector, rate: Vector, alpha: Vector, tau: float, huber: float) -> None:
        """Compute innovation, cost, derivatives and update; R (3,) is the diagonal of the noise."""
        theta, g, x = self.theta, self.problem.gravity, self.x
        E = np.eye(3) + tau * cross(rate)
        L = cross(alpha) + cross(rate) @ cross(rate)
        H = theta.D @ np.hstack([E, np.zeros((3, 6)), np.eye(3)])
        q = E @ x[:3] + x[9:] + L @ theta.r
        e = y - theta.D @ q - theta.b_a
        de = -self.dx @ H.T
        de[PLACES["D"]] -= np.kron(np.eye(3), q[:, None])
        de[PLACES["b_a"]] -= np.eye(3)
        de[PLACES["tau"]] -= theta.D @ cross(rate) @ x[:3]
        de[PLACES["r"]] -= (theta.D @ L).T
        gain = self._gain(H, e, np.diag(R), huber) if self.held is None else self.held[len(self.gains)]
        self.gains.append(gain)
        self.innovations.append(e)
        self.gradient += gain.w * de @ gain.Si @ e
        self.fisher += gain.w * de @ gain.Si @ de.T
        self.x, self.dx = x + gain.K @ e, self.dx + de @ gain.K.T
        self.P = self.P - gain.K @ H @ self.P
        norm = float(np.linalg.norm(self.x[:3]))
        u = self.x[:3] / norm
        self.x[:3] = g * u
        self.dx[:, :3] = g / norm * (self.dx[:, :3] - np.outer(self.dx[:, :3] @ u, u))

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
