"""How well D and b_a are known while the board is still being turned, and which rest would teach most.

The hand's model on averaged samples, by one search from the last estimate: rougher than a calibration, and twenty times
as fast. Knows no session and no clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..data import Recording, Vector
from .hand import FARTHER, FIRST_MPS2, HONEST, PIVOT_MPS2, WHITE_MPS2, near, prior_of
from .initialise import initialise
from .likelihood import NAMES, Problem, Series, Theta, evaluate, trace, value
from .minimise import Minimum, Prior, minimise
from .model import Flat, rotation
from .scene import CORRELATION_S, FLOOR_MPS2, MOVING_RAD_S, POSE_MPS2, Scene, jerk_density, prepare
from .thin import thinned

# Fast enough for a hand's moves, few enough samples for a fit within a poll or two.
FIT_HZ = 50.0
ROUGHLY, MOST_ROUGHLY = 0.05, 4

# So weak that nothing measured gives way to them, strong enough for a D of which nothing is known yet.
D_SD, B_A_SD_MPS2 = 0.5, 5.0

# What a person does when asked for an orientation.
MOVE_S, REST_S = 1.6, 2.0
FAST_RAD_S = math.radians(130.0) / MOVE_S
TREMOR_MPS2 = 0.07
NEAR_RAD = math.radians(25.0)


@dataclass(frozen=True)
class Known:
    """A rough estimate and what it rests on.

    Attributes
    ----------
    theta : the estimate. H : (27, 27) its Fisher matrix with the prior's. covariance : (12, 12) of D row-major and b_a.
    problem : the series up to now. sigma : m/s^2, of the hand's acceleration while it moves.
    converged : whether the search settled.
    """

    theta: Theta
    H: Vector
    covariance: Vector
    problem: Problem
    sigma: float
    converged: bool

    @property
    def D_std(self) -> Vector:  # noqa: N802 - the paper's letter
        """(3, 3) standard deviations."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance)[:9], 0.0)).reshape(3, 3))

    @property
    def b_a_std(self) -> Vector:
        """(3,) standard deviations [m/s^2]."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance)[9:], 0.0)))


def know(recording: Recording, flat: Flat, gravity: float, before: Known | None = None) -> Known:
    """What `recording` tells so far.

    The search goes on from `before`, where that had settled and nothing else explains the recording better by now; else
    it begins with a loss that finds its way from afar.
    """
    scene = prepare(*thinned(recording, flat, FIT_HZ), gravity)
    prior = _prior(scene.flat)
    rough = replace(scene.white(FIRST_MPS2), tail=0.0)
    starts = _starts(scene) if before is None else (*_starts(scene), before.theta)
    theta = min(starts, key=lambda start: value(rough, start) + prior.cost(start))
    if before is not None and before.converged and theta is before.theta:
        sigma = before.sigma
    else:
        theta = _right_handed(_minimum(rough, theta, prior).theta)
        sigma = _likeliest(scene, theta, WHITE_MPS2)
    problem = scene.white(sigma, CORRELATION_S)
    minimum = _minimum(problem, theta, prior)
    H = minimum.H
    if not scene.rests_often:
        # who does not pause leans on a hand's travel, of which little is known: as the calibration, admit more of it
        pivot = min(PIVOT_MPS2, key=lambda s: value(scene.pivot(s, FLOOR_MPS2), minimum.theta))
        doubt = scene.pivot(HONEST * FARTHER * pivot, FLOOR_MPS2)
        H = evaluate(doubt, minimum.theta, len(NAMES)).fisher + np.diag(prior.precision)
    covariance = replace(minimum, H=H).covariance()[:12, :12]
    sigma = _likeliest(scene, minimum.theta, near(sigma))
    return Known(minimum.theta, H, covariance, problem, sigma, minimum.converged)


def most_helpful(known: Known, wanted: Vector, directions: Vector) -> int:
    """Which of `directions`, pointing down at rest, would reduce the uncertainty fastest.

    The Fisher information of a move there and a rest is added to what is known; what counts is the sum of
    (variance / wanted^2), by how much a second reduces its logarithm.

    Parameters
    ----------
    wanted : (12,) standard deviations, of D row-major and b_a. directions : (k, 3) unit vectors in the body frame.
    """
    s = trace(known.problem, known.theta).s[-1]
    here = -s / np.linalg.norm(s)
    now = _badness(known.H, wanted)
    best, most = 0, -np.inf
    for i, down in enumerate(directions):
        angle = math.acos(float(np.clip(here @ down, -1.0, 1.0)))
        if angle < NEAR_RAD:
            continue
        seconds = max(MOVE_S, angle / FAST_RAD_S)
        then = _badness(known.H + _information(_move_and_rest(known, s, down, seconds), known.theta, s), wanted)
        gain = (math.log(now) - math.log(then)) / (seconds + REST_S)
        if gain > most:
            best, most = i, gain
    return best


def _starts(scene: Scene) -> tuple[Theta, ...]:
    """A perfect sensor, but for the bias that the flat mean then says, and the linear estimate."""
    flat = scene.flat
    u = flat.y / np.linalg.norm(flat.y)
    perfect = Theta.start(np.eye(3), flat.y - scene.problem.gravity * u, flat.b_omega, u)
    return perfect, initialise(scene.problem, flat.b_omega)


def _right_handed(theta: Theta) -> Theta:
    """Of (D, u) and (-D, -u), which fit equally well, the one with det D > 0."""
    return theta if np.linalg.det(theta.D) > 0.0 else replace(theta, D=-theta.D, u=-theta.u)


def _minimum(problem: Problem, theta: Theta, prior: Prior) -> Minimum:
    return minimise(problem, theta, len(NAMES), prior, until=ROUGHLY, most=MOST_ROUGHLY, frozen=True)


def _likeliest(scene: Scene, theta: Theta, sigmas: tuple[float, ...]) -> float:
    return min(sigmas, key=lambda sigma: value(scene.white(sigma), theta))


def _prior(flat: Flat) -> Prior:
    return prior_of(flat, D=(np.eye(3).ravel(), D_SD), b_a=(0.0, B_A_SD_MPS2))


def _badness(H: Vector, wanted: Vector) -> float:
    scale = 1.0 / np.sqrt(np.diag(H))
    variance = np.diag(np.linalg.inv(H * np.outer(scale, scale))) * scale**2
    return float(np.sum(np.abs(variance[:12]) / wanted**2))


def _information(problem: Problem, theta: Theta, s: Vector) -> Vector:
    """(p, p) Fisher matrix of a problem that begins at rest with gravity s (3,), whatever the pose there."""
    F = evaluate(problem, replace(theta, u=s / np.linalg.norm(s)), len(NAMES)).fisher
    pose = slice(12, 14)
    F = F - F[:, pose] @ np.linalg.solve(F[pose, pose], F[pose])
    F[:, pose] = F[pose] = 0.0
    return F


def _move_and_rest(known: Known, s: Vector, down: Vector, seconds: float) -> Problem:
    """A rest with gravity s (3,), the shortest turn from there to `down` (3,) in so many seconds, and a rest there."""
    problem, theta = known.problem, known.theta
    dt = float(np.median(problem.series.dt))
    move, rest = max(round(seconds / dt), 2), max(round(REST_S / dt), 2)
    turn = _shortest_turn(s / np.linalg.norm(s), -down)
    # s in the body's axes turns against the body
    share = np.append(np.arange(1, move + 1) / move, np.ones(rest))
    path = rotation(share[:, None] * turn) @ s
    omega = np.zeros((move + rest, 3))
    omega[:move] = -turn / (move * dt)
    speed2 = np.sum(omega**2, axis=1)
    moving = speed2 / (speed2 + MOVING_RAD_S**2)
    longer = 1.0 + 2.0 * CORRELATION_S / dt
    resting = np.arange(move + rest) >= move
    reset = np.full(move + rest, -1.0)
    reset[0], reset[move] = 0.0, TREMOR_MPS2
    series = Series(
        y=path @ theta.D.T + theta.b_a,
        omega=omega @ np.linalg.inv(theta.K).T + theta.b_omega,
        dt=np.full(move + rest, dt),
        rate=omega,
        alpha=np.zeros_like(omega),
        r_extra=np.where(resting, POSE_MPS2**2 * rest, longer * known.sigma**2 * moving),
        jerk=np.where(resting, jerk_density(TREMOR_MPS2, problem.lam), 0.0),
        reset=reset,
    )
    flat = replace(problem.flat, first=0, last=rest, y=theta.D @ s + theta.b_a)
    return replace(problem, series=series, flat=flat)


def _shortest_turn(a: Vector, b: Vector) -> Vector:
    """(3,) rad, the rotation vector that takes unit vector a to b."""
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-6:
        if a @ b > 0.0:
            return np.zeros(3)
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return np.asarray(math.pi * axis / np.linalg.norm(axis))
    return np.asarray(axis / sine * math.atan2(sine, float(a @ b)))
