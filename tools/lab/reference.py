"""The exact filter in plain NumPy, a step at a time: slow, short, and the oracle of the kernel's tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mpucal.calibration.likelihood import Evaluation
from mpucal.calibration.parameters import ACCEL, PLACES
from mpucal.calibration.problem import Problem
from mpucal.calibration.rotation import cross, left_jacobian, rotation
from mpucal.calibration.sphere import tangents
from mpucal.calibration.theta import Theta
from mpucal.data import Vector

K_BASIS = np.zeros((6, 3, 3))
for _m, (_i, _j) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
    K_BASIS[_m, _i, _j] = K_BASIS[_m, _j, _i] = 1.0


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
