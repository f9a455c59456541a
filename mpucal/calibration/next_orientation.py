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
from .rotation import cross_rows, lengths, shortest_turns

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
    moves = _moves(known, s, directions[there], seconds)
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


def _moves(known: InterimEstimate, s: Vector, directions: Vector, seconds: Vector) -> Iterator[Problem]:
    """Yield for each of `directions` (k, 3) a rest with gravity s (3,), the shortest turn there, and a rest."""
    problem, theta = known.problem, known.theta
    dt = float(np.median(problem.series.dt))
    rest, moves = max(round(REST_S / dt), 2), np.maximum(np.rint(seconds / dt).astype(np.intp), 2)
    turns = shortest_turns(np.broadcast_to(s / np.linalg.norm(s), directions.shape), -directions)
    angle = lengths(turns)
    # In the body's axes, s turns against the body, in the plane perpendicular to the turn.
    across = cross_rows(turns / angle[:, None], s)
    number = np.arange(1, moves.max() + rest + 1)
    moving, share = number <= moves[:, None], angle[:, None] * np.minimum(number / moves[:, None], 1.0)
    path = np.cos(share)[:, :, None] * s + np.sin(share)[:, :, None] * across[:, None]
    omega = np.where(moving[:, :, None], (-turns / (moves * dt)[:, None])[:, None], 0.0)
    speed2 = (angle / (moves * dt)) ** 2
    moving_noise = (1.0 + 2.0 * CORRELATION_S / dt) * known.sigma**2 * speed2 / (speed2 + MOVING_RAD_S**2)
    reset = np.full(moving.shape, -1.0)
    reset[:, 0], reset[range(len(moves)), moves] = 0.0, SWAY_MPS2
    every = Series(
        y=path @ theta.D.T + theta.b_a,
        omega=omega @ np.linalg.inv(theta.K).T + theta.b_omega,
        dt=np.full(moving.shape, dt),
        rate=omega,
        alpha=np.zeros_like(omega),
        r_extra=np.where(moving, moving_noise[:, None], POSE_MPS2**2 * rest),
        jerk=np.where(moving, 0.0, jerk_density(SWAY_MPS2, problem.lam)),
        reset=reset,
    )
    flat = replace(problem.flat, first=0, last=rest, y=theta.D @ s + theta.b_a)
    given = {name: values for name, values in vars(every).items() if values is not None}
    for k, n in enumerate((moves + rest).tolist()):
        yield replace(problem, series=Series(**{name: values[k, :n] for name, values in given.items()}), flat=flat)
