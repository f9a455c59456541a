"""Likelihood: V(theta), its gradient and its Fisher matrix over a recording, by the kernel.

There are two filters: the exact one for a sensor that turns in place, and the hand's, whose state includes the hand's
travel (kernel/filter.hpp and kernel/hand.hpp).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from ..kernel import _kernel
from .parameters import ACCEL, HAND, IMU, LANES, LANES_OF_S, LAYOUT, NAMES, lanes_used
from .problem import SERIES, SERIES_OF_A_HAND, Problem, Series
from .theta import Theta

if _kernel.layout != LAYOUT:
    raise ImportError("the kernel was built for another table of parameters: build it again")

USED = {0: 0, ACCEL: lanes_used("accel"), IMU: lanes_used("imu")}


class Evaluation(NamedTuple):
    """Cost V, sum of e' S^-1 e over the samples, gradient (p,) and Fisher matrix (p, p) in the order of NAMES.

    to_ends : gradients (k, lanes) and Fisher matrices (k, lanes, lanes) up to each of k ends, in the kernel's order;
        None where no ends were given.
    """

    V: float
    squares: float
    gradient: Vector
    fisher: Vector
    to_ends: tuple[Vector, Vector] | None = None


def evaluate(problem: Problem, theta: Theta, parameters: int, ends: NDArray[np.int64] | None = None) -> Evaluation:
    """Evaluate V(theta) with its derivatives by the first `parameters` of NAMES.

    ACCEL, IMU (or 0: V alone) use equation (8) by the exact filter. HAND uses the hand's filter, whose derivatives hold
    gains and weights fixed: the gradient is zero where the estimate should be, not where V is least. SENSITIVE adds the
    derivatives by S (9,), row-major, at S = 0, to a series with forces.

    Parameters
    ----------
    ends : (k,) where parts of the series end, the last one the number of samples; the kernel moves them on by less
        than a block of steps. Their sums cost next to nothing.

    Raises
    ------
    ValueError : the exact filter was called with a problem that only the hand's filter can solve.
    """
    if parameters >= HAND:
        V, squares, gradient, fisher = _hand(problem, theta, derivatives=True, ends=ends)
    else:
        _refuse_a_hand(problem)
        V, squares, gradient, fisher = _exact(problem, theta, parameters, ends)
    lanes = _lanes(parameters)
    to_ends = None if ends is None else (gradient, fisher)
    return Evaluation(V, squares, gradient[-1, lanes], fisher[-1, lanes[:, None], lanes], to_ends)


class PartScores(NamedTuple):
    """Shares of each part of a series in gradient (k, p) and Fisher matrix (k, p, p), and those of the flat mean."""

    gradient: Vector
    fisher: Vector
    flat: Evaluation

    def moved(self, step: Vector) -> PartScores:
        """Return the scores after a step (p,), to second order."""
        flat = self.flat._replace(gradient=self.flat.gradient + self.flat.fisher @ step)
        return PartScores(self.gradient + self.fisher @ step, self.fisher, flat)


def part_scores(problem: Problem, theta: Theta, parameters: int, to_ends: tuple[Vector, Vector]) -> PartScores:
    """Return gradient and Fisher matrix, part by part, with the filter's memory of the parts before.

    The flat segment's mean, by which the filter begins, belongs to no part.

    Parameters
    ----------
    to_ends : as evaluate returned it for this problem at theta.
    """
    begin = evaluate(problem.first(0), theta, parameters)
    lanes = _lanes(parameters)
    gradient, fisher = to_ends[0][:, lanes], to_ends[1][:, lanes[:, None], lanes]
    return PartScores(
        np.diff(gradient, axis=0, prepend=begin.gradient[None]),
        np.diff(fisher, axis=0, prepend=begin.fisher[None]),
        begin,
    )


def slope_by_noise(problem: Problem, theta: Theta) -> Vector:
    """Return minus the mean of the gradient of V (p,) at the true parameters, which the rates' noise makes by K.

    The rates are in the derivatives by K, with the noise that is in the innovations, too ("errors in variables"). So
    the gradient's mean is minus the sum of tr(S^-1 dS/dK) / 2 over the samples, where S depends on K by the noise. A
    factor of an axis' K acts on S as the square root of its noise's variance does, inversely. The exact filter is used
    for a hand, too.
    """
    exact, step = Series(**problem.series.arrays(SERIES)), 0.02

    def log_det(factor: Vector | float) -> float:
        """Return the sum of log det S / 2 with the variance of the rates' noise multiplied by a factor."""
        flat = replace(problem.flat, Sigma_omega=problem.flat.Sigma_omega * factor)
        at = evaluate(Problem(exact, flat, problem.gravity), theta, 0)
        return at.V - 0.5 * at.squares

    slope, here = np.zeros(len(NAMES)), log_det(1.0)
    for name, axis in zip(("K_xx", "K_yy", "K_zz"), np.eye(3), strict=True):
        slope[NAMES.index(name)] = 2.0 * (here - log_det(np.exp(step * axis))) / step
    return slope


def value(problem: Problem, theta: Theta) -> float:
    """Return V(theta) of the hand's filter."""
    return _hand(problem, theta, derivatives=False)[0]


class Trace(NamedTuple):
    """Predictions of the hand's filter for every sample, (n, 3) each.

    innovation : whitened, L^-1 e. s : m/s^2, gravity in the body frame.
    """

    innovation: NDArray[np.float64]
    s: NDArray[np.float64]


def trace(problem: Problem, theta: Theta) -> Trace:
    """Run the hand's filter, and return its predictions sample by sample."""
    series = problem.series.arrays(SERIES + SERIES_OF_A_HAND)
    return Trace(*_kernel.trace_hand(theta.packed, problem.constants_of_a_hand(), **series))


def _exact(
    problem: Problem, theta: Theta, parameters: int, ends: NDArray[np.int64] | None = None
) -> tuple[float, float, Vector, Vector]:
    series = problem.series.arrays(SERIES)
    return _kernel.evaluate(theta.packed_exact, problem.constants(), USED[parameters], **series, ends=ends)


def _hand(
    problem: Problem, theta: Theta, derivatives: bool, ends: NDArray[np.int64] | None = None
) -> tuple[float, float, Vector, Vector]:
    series = problem.series.arrays(SERIES + SERIES_OF_A_HAND)
    constants = problem.constants_of_a_hand()
    return _kernel.evaluate_hand(theta.packed, constants, derivatives, **series, ends=ends)


@cache
def _lanes(parameters: int) -> NDArray[np.intp]:
    return np.array((LANES + LANES_OF_S)[:parameters], np.intp)


def _refuse_a_hand(problem: Problem) -> None:
    given = [name for name in SERIES_OF_A_HAND if getattr(problem.series, name) is not None]
    given += ["huber"] if np.isfinite(problem.huber) else []
    if given:
        raise ValueError(f"the exact filter does not support {', '.join(given)}: evaluate all {HAND} parameters")
