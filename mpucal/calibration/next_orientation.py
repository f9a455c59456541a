"""Next orientation to ask for: the rest that reduces the uncertainty fastest, by its Fisher information.

A weighted A-criterion: the sum of (variance / wanted^2) over D and b_a (docs/method.md, equation 17).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..data import Vector
from ..rests.limits import LEAST_TURN_RAD, MOVING_RAD_S
from .interim import InterimEstimate
from .likelihood import evaluate, trace
from .normal_equations import inverse
from .parameters import ACCELEROMETER, HAND, PLACES
from .poses import POSE_MPS2
from .preprocessing import CORRELATION_S, jerk_density
from .problem import Problem, Series
from .rotation import cross, shortest_turn

# These describe how a person turns the board to an orientation, and holds it there.
MOVE_S, REST_S = 1.6, 2.0
FAST_RAD_S = math.radians(130.0) / MOVE_S
SWAY_MPS2 = 0.02  # what a low pass leaves of a seated hand's acceleration


def next_orientation(known: InterimEstimate, wanted: Vector, directions: Vector) -> int:
    """Return the index of the direction that, pointing down at rest, would reduce the uncertainty fastest.

    The Fisher information of a move there and of a rest is added to the present one; the criterion is the reduction
    per second of the logarithm of the sum of (variance / wanted^2).

    Parameters
    ----------
    wanted : (12,) standard deviations, of D row-major and b_a. directions : (k, 3) unit vectors in the body frame.
    """
    s = trace(known.problem, known.theta).s[-1]
    angle = np.arccos(np.clip(directions @ (-s / np.linalg.norm(s)), -1.0, 1.0))
    there = np.flatnonzero(angle >= LEAST_TURN_RAD)
    if not len(there):  # an estimate that diverged knows no directions
        return 0
    seconds = np.maximum(MOVE_S, angle[there] / FAST_RAD_S)
    moves = _moves(known, s, directions[there], seconds.tolist())
    begin = replace(known.theta, u=s / np.linalg.norm(s))
    F = _without_pose(np.array([evaluate(move, begin, HAND).fisher for move in moves]))
    then, now = _criterion(known.H + F, wanted), _criterion(known.H, wanted)
    gain = (np.log(now) - np.log(then)) / (seconds + REST_S)
    return int(there[np.argmax(gain)])


def _criterion(H: Vector, wanted: Vector) -> Vector:
    """Return the A-criterion (...) of Fisher matrices (..., p, p)."""
    variance = np.diagonal(inverse(H), axis1=-2, axis2=-1)
    return np.asarray(np.sum(np.abs(variance[..., ACCELEROMETER]) / wanted**2, axis=-1))


def _without_pose(F: Vector) -> Vector:
    """Return Fisher matrices (k, p, p) with the pose in which they begin eliminated."""
    pose = PLACES["tilt"]
    F = F - F[:, :, pose] @ np.linalg.solve(F[:, pose, pose], F[:, pose])
    F[:, :, pose] = F[:, pose] = 0.0
    return np.asarray(F)


def _moves(known: InterimEstimate, s: Vector, directions: Vector, seconds: list[float]) -> Iterator[Problem]:
    """Yield for each of `directions` (k, 3) a rest with gravity s (3,), the shortest turn there, and a rest."""
    problem, theta = known.problem, known.theta
    dt = float(np.median(problem.series.dt))
    rest = max(round(REST_S / dt), 2)
    rates = np.linalg.inv(theta.K)
    moving_noise = (1.0 + 2.0 * CORRELATION_S / dt) * known.sigma**2
    flat = replace(problem.flat, first=0, last=rest, y=theta.D @ s + theta.b_a)
    for down, each_s in zip(directions, seconds, strict=True):
        move = max(round(each_s / dt), 2)
        turn = shortest_turn(s / np.linalg.norm(s), -down)
        # In the body's axes, s turns against the body, in the plane perpendicular to the turn.
        angle = float(np.linalg.norm(turn))
        across = cross(turn / angle) @ s
        share = angle * np.minimum(np.arange(1, move + rest + 1) / move, 1.0)[:, None]
        path = np.cos(share) * s + np.sin(share) * across
        omega = np.zeros((move + rest, 3))
        omega[:move] = -turn / (move * dt)
        speed2 = (angle / (move * dt)) ** 2
        r_extra = np.full(move + rest, POSE_MPS2**2 * rest)
        r_extra[:move] = moving_noise * speed2 / (speed2 + MOVING_RAD_S**2)
        jerk = np.zeros(move + rest)
        jerk[move:] = jerk_density(SWAY_MPS2, problem.lam)
        reset = np.full(move + rest, -1.0)
        reset[0], reset[move] = 0.0, SWAY_MPS2
        series = Series(
            y=path @ theta.D.T + theta.b_a,
            omega=omega @ rates.T + theta.b_omega,
            dt=np.full(move + rest, dt),
            rate=omega,
            alpha=np.zeros_like(omega),
            r_extra=r_extra,
            jerk=jerk,
            reset=reset,
        )
        yield replace(problem, series=series, flat=flat)
