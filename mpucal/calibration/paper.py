"""Algorithm 1 of the paper, as printed: the reference for the other estimators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from .ekf import Ekf, inverse
from .fit import Fit
from .levenberg_marquardt import DECREMENT
from .parameters import B_A_NAMES, D_NAMES

MAX_ITERATIONS = 10
WOLFE_1, WOLFE_2 = 1e-4, 0.9  # sufficient decrease and curvature, as Nocedal and Wright set them

H_DIFFERENCE = 1e-5
STEPS = 2.0 ** np.arange(2, -7, -1)  # down to the least length, epsilon_2, in units of the first


def fit_paper(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate D and b_a by maximum likelihood (7) from the samples that follow the flat segment.

    Parameters
    ----------
    recording : the flat segment and what follows. flat : its statistics, line 1. gravity : |g| [m/s^2].

    A fit that diverges is returned where it stood, with converged False.
    """
    ekf = Ekf.after(flat, recording, gravity)  # 1:
    theta = np.concatenate([np.eye(3).ravel(), np.zeros(3)])  # 2:
    # Far from the optimum V overflows; it is then infinite, and the line search turns back.
    with np.errstate(all="ignore"):
        here, iterations, converged = _minimise(ekf, expand(ekf, theta))
        covariance = _covariance(here.H)
    return Fit(
        D=here.theta[:9].reshape(3, 3),
        b_a=here.theta[9:],
        b_omega=flat.b_omega,
        K=np.eye(3),
        names=D_NAMES + B_A_NAMES,
        covariance=covariance,
        iterations=iterations,
        converged=converged,
        nis=here.nis,
        V=here.V,
    )


@dataclass(frozen=True)
class Expansion:
    """V, its gradient (p,) and its approximate Hessian H (p, p) at theta (p,); nis is the mean ||e||^2 of S^-1."""

    theta: Vector
    V: float
    gradient: Vector
    H: Vector
    nis: float

    @property
    def finite(self) -> bool:
        """True if the filter stayed finite at theta and around it."""
        return bool(np.isfinite(self.V) and np.isfinite(self.gradient).all() and np.isfinite(self.H).all())

    def direction(self) -> Vector:
        """Return the Gauss-Newton step, of least norm where the data leave a direction of theta open."""
        return np.asarray(np.linalg.lstsq(self.H, -self.gradient, rcond=None)[0], np.float64)


def expand(ekf: Ekf, theta: Vector) -> Expansion:
    """Expand V (8) at theta by central differences: theta and its 24 neighbours in one pass of the EKF.

    Read literally, the paper's Hessian (dV/dtheta)^T (dV/dtheta) has rank 1 and leads nowhere. Gauss-Newton on the
    whitened innovations is the reading that works: the Fisher information
    H = sum de^T S^-1 de + tr(S^-1 d_iS S^-1 d_jS) / 2.
    """
    p, h = len(theta), H_DIFFERENCE
    around = theta + h * np.concatenate([np.zeros((1, p)), np.eye(p), -np.eye(p)])
    V, nis, H = np.zeros(2 * p + 1), 0.0, np.zeros((p, p))
    for block in ekf.run(around[:, :9].reshape(-1, 3, 3), around[:, 9:]):
        e, S = block.e, block.S
        chi2, log_det = _terms(e, S)
        V += 0.5 * (chi2 + log_det).sum(0)
        nis += chi2[:, 0].sum()
        W = inverse(S[:, 0])[0]
        d_e = (e[:, 1 : p + 1] - e[:, p + 1 :]) / (2 * h)
        d_S = (S[:, 1 : p + 1] - S[:, p + 1 :]) / (2 * h)
        W_d_S = W[:, None] @ d_S
        H += _inner(d_e, d_e @ W) + 0.5 * _inner(W_d_S, np.swapaxes(W_d_S, -1, -2))
    gradient = (V[1 : p + 1] - V[p + 1 :]) / (2 * h)
    return Expansion(theta, float(V[0]), gradient, 0.5 * (H + H.T), float(nis) / max(len(ekf.y), 1))


def _minimise(ekf: Ekf, here: Expansion) -> tuple[Expansion, int, bool]:
    """Run lines 3 to 7; return where the minimisation ends, its iterations, and True if it converged."""
    for i in range(MAX_ITERATIONS + 1):  # 3:, 7:
        if not here.finite:
            return here, i, False
        direction = here.direction()  # 6:
        if -0.5 * here.gradient @ direction < DECREMENT:
            return here, i, True
        if i == MAX_ITERATIONS:
            break
        following = expand(ekf, here.theta + direction)  # 4:, 5:
        if not _wolfe(here, direction, 1.0, following.V, float(following.gradient @ direction)):
            step = _line_search(ekf, here, direction)
            if step == 0.0:
                return here, i, False
            following = expand(ekf, here.theta + step * direction)
        here = following
    return here, MAX_ITERATIONS, False


def _line_search(ekf: Ekf, here: Expansion, direction: Vector) -> float:
    """Return the longest of STEPS with both Wolfe conditions, else the best with sufficient decrease, else 0."""
    h = H_DIFFERENCE
    V = _costs(ekf, here.theta + np.concatenate([STEPS, STEPS + h])[:, None] * direction).reshape(2, -1)
    slopes = (V[1] - V[0]) / h
    for step, V_step, slope in zip(STEPS, V[0], slopes, strict=True):
        if _wolfe(here, direction, step, V_step, slope):
            return float(step)
    enough = V[0] <= here.V + WOLFE_1 * STEPS * (here.gradient @ direction)
    return float(STEPS[np.argmin(np.where(enough, V[0], np.inf))]) if enough.any() else 0.0


def _wolfe(here: Expansion, direction: Vector, step: float, V: float, slope: float) -> bool:
    """Return True if a step that ends at V, with this slope along the direction, meets both Wolfe conditions."""
    descent = here.gradient @ direction
    return bool(here.V + WOLFE_1 * step * descent >= V and slope >= WOLFE_2 * descent)


def _costs(ekf: Ekf, thetas: Vector) -> Vector:
    """Return V (8) of each of the parameter sets (b, 12)."""
    V = np.zeros(len(thetas))
    for block in ekf.run(thetas[:, :9].reshape(-1, 3, 3), thetas[:, 9:]):
        chi2, log_det = _terms(block.e, block.S)
        V += 0.5 * (chi2 + log_det).sum(0)
    return np.where(np.isfinite(V), V, np.inf)


def _terms(e: Vector, S: Vector) -> tuple[Vector, Vector]:
    """Return the terms of (8): ||e||^2 weighted by S^-1, and log det S."""
    W, determinant = inverse(S)
    return (e * (W @ e[..., None])[..., 0]).sum(-1), np.log(determinant)


def _inner(a: Vector, b: Vector) -> Vector:
    """Return inner products (p, p) over samples and components of (t, p, ...) with (t, p, ...)."""
    p = a.shape[1]
    product: Vector = np.swapaxes(a, 0, 1).reshape(p, -1) @ np.swapaxes(b, 0, 1).reshape(p, -1).T
    return product


def _covariance(H: Vector) -> Vector:
    """Return the inverse of H; NaN where H is singular."""
    try:
        return np.asarray(np.linalg.inv(H), np.float64)
    except np.linalg.LinAlgError:
        return np.full_like(H, np.nan)
