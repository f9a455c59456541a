"""The orientation to ask for next: the rest that reduces the uncertainty fastest, by its Fisher information.

A weighted A-criterion: the sum of (variance / wanted^2) over D and b_a (docs/method.md, equation 17).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..data import Vector
from .interim import InterimEstimate
from .likelihood import evaluate, trace
from .parameters import ACCELEROMETER, HAND, PLACES
from .preprocessing import CORRELATION_S, MOVING_RAD_S, POSE_MPS2, jerk_density
from .problem import Problem, Series
from .rotation import rotation, shortest_turn
from .theta import Theta

# What a person does when asked for an orientation.
MOVE_S, REST_S = 1.6, 2.0
FAST_RAD_S = math.radians(130.0) / MOVE_S
TREMOR_MPS2 = 0.07

NEAR_RAD = math.radians(25.0)  # a direction as near as that is where the board is already


def next_orientation(known: InterimEstimate, wanted: Vector, directions: Vector) -> int:
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


def _badness(H: Vector, wanted: Vector) -> float:
    scale = 1.0 / np.sqrt(np.diag(H))
    variance = np.diag(np.linalg.inv(H * np.outer(scale, scale))) * scale**2
    return float(np.sum(np.abs(variance[ACCELEROMETER]) / wanted**2))


def _information(problem: Problem, theta: Theta, s: Vector) -> Vector:
    """(p, p) Fisher matrix of a problem that begins at rest with gravity s (3,), whatever the pose there."""
    F = evaluate(problem, replace(theta, u=s / np.linalg.norm(s)), HAND).fisher
    pose = PLACES["tilt"]
    F = F - F[:, pose] @ np.linalg.solve(F[pose, pose], F[pose])
    F[:, pose] = F[pose] = 0.0
    return F


def _move_and_rest(known: InterimEstimate, s: Vector, down: Vector, seconds: float) -> Problem:
    """A rest with gravity s (3,), the shortest turn from there to `down` (3,) in so many seconds, and a rest there."""
    problem, theta = known.problem, known.theta
    dt = float(np.median(problem.series.dt))
    move, rest = max(round(seconds / dt), 2), max(round(REST_S / dt), 2)
    turn = shortest_turn(s / np.linalg.norm(s), -down)
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
