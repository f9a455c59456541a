"""The estimator for a sensor in a hand: gyro matrix, lever arm, the hand's own acceleration, jerks, drift.

The noise of the hand is found first, on means over blocks. While it moves, its acceleration is white; a recording that
needs none (a bench, or a hand that only jerks) ends there. Else it is coloured: where the board rests often, white of a
correlation time; where it hardly rests, the second derivative of a position that stays bounded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..data import Recording, Vector
from .gyro import K_MEAN, K_SD, WALD_99, at_prior, wald
from .initialise import initialise
from .likelihood import NAMES, Problem, Theta, evaluate, value
from .minimise import Minimum, Prior, minimise
from .model import Fit, Flat
from .moves import explaining, leverages, moves_of, q_scale
from .scene import CORRELATION_S, FLOOR_MPS2, Scene, prepare
from .thin import thinned

LEVER_SD_M = 0.3
DELAY_SD_S = 0.002
SEARCH_HZ = 50.0
ROUGHLY, MOST_ROUGHLY = 0.05, 20
PASSES = 3

FIRST_MPS2 = 0.3
WHITE_MPS2 = (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
HAND_MPS2 = WHITE_MPS2[4:]  # who goes from rest to rest, has a hand
PIVOT_MPS2 = (0.1, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
# A pivot travels farther than a bounded position of one lambda, the more the wilder it is: sigma (1.5 + 0.5 sigma) for
# the estimate, and six times that for what its covariance admits.
FARTHER, FARTHER_STILL, HONEST = 1.5, 0.5, 6.0


@dataclass(frozen=True)
class Noise:
    """The hand's acceleration while it moves: none, white (correlated), or a pivot's, of sigma m/s^2."""

    kind: Literal["none", "white", "pivot"]
    sigma: float

    def problem(self, scene: Scene) -> Problem:
        """The scene with this noise."""
        if self.kind == "pivot":
            return scene.pivot(self.sigma, FLOOR_MPS2)
        return scene.white(self.sigma, CORRELATION_S if self.kind == "white" else 0.0)


def fit_hand(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega, K, lever arm r and delay tau of a sensor that a hand moves."""
    fine = prepare(recording, (flat.first, flat.last), gravity)
    search = _Search(prepare(*thinned(recording, flat, SEARCH_HZ), gravity))
    theta, noise = search.run(initialise(fine.problem, fine.flat.b_omega))
    if noise.kind == "white":  # means over blocks hide jerks, and with them some of the hand
        noise = Noise("white", _likeliest(fine.white, near(noise.sigma), theta))
    problem = _moved(noise.problem(fine), fine, theta)
    prior = prior_of(fine.flat)
    minimum = minimise(problem, theta, len(NAMES), prior, frozen=True)
    iterations = search.iterations + minimum.iterations
    if wald(minimum) < WALD_99 and not at_prior(minimum.covariance()):
        perfect = replace(minimum.theta, K=np.eye(3))
        minimum = minimise(problem, perfect, len(NAMES), prior, fixed=("K",), frozen=True)
        iterations += minimum.iterations
    minimum = _doubted(minimum, noise, search.scene, fine)
    known = at_prior(minimum.covariance()) if minimum.free.all() else ()
    return replace(minimum, iterations=iterations).as_fit(known)


def _doubted(minimum: Minimum, noise: Noise, rough: Scene, fine: Scene) -> Minimum:
    """The minimum with an honest H.

    What moves miss by after the fit is less than what the gyroscope erred by: few moves and many parameters leave next
    to nothing. Their noise is found anew, by misses that count for what an estimate leaves of them; the estimate itself
    gains nothing by it.
    """
    if noise.kind == "none":
        return minimum
    if noise.kind == "pivot":
        noise = replace(noise, sigma=HONEST * noise.sigma)
    prior, fixed = prior_of(fine.flat), () if minimum.free.all() else ("K",)
    at, problem, moves = minimum, noise.problem(rough), moves_of(rough, minimum.theta)
    variance, leverage = explaining(moves), np.zeros(1)
    for _ in range(PASSES if moves else 0):
        leverage = leverages(moves, rough, at.theta, at.covariance(), variance)
        variance = explaining(moves, leverage)
        problem = _scaled(problem, q_scale(moves, variance, len(problem.series)))
        at = _roughly(problem, at.theta, prior, fixed)
        moves = moves_of(rough, at.theta)
    problem, moves = noise.problem(fine), moves_of(fine, at.theta)
    if moves:  # rests are found anew here, and their number may differ by one
        variance = explaining(moves, float(leverage.mean()))
        problem = _scaled(problem, q_scale(moves, variance, len(problem.series)))
    fisher = evaluate(problem, minimum.theta, len(NAMES)).fisher
    return replace(minimum, H=fisher + np.diag(prior.precision))


def _moved(problem: Problem, scene: Scene, theta: Theta) -> Problem:
    """The problem with as much noise of the gyroscope between rests as the rests show, under theta."""
    moves = moves_of(scene, theta)
    return _scaled(problem, q_scale(moves, explaining(moves), len(problem.series))) if moves else problem


def _scaled(problem: Problem, factor: Vector) -> Problem:
    """The problem with `factor` (n,) of the gyroscope's noise."""
    return replace(problem, series=replace(problem.series, q_scale=factor))


def prior_of(flat: Flat, **more: tuple[Vector | float, Vector | float]) -> Prior:
    """What is known beforehand: b_omega by the flat segment, K by a data sheet, tau and r by chips and hands.

    more : of further parameters, as Prior.of takes them.
    """
    return Prior.of(
        b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)),
        K=(K_MEAN, K_SD),
        tau=(0.0, DELAY_SD_S),
        r=(0.0, LEVER_SD_M),
        **more,
    )


class _Search:
    """The minimiser's way to a theta and a noise, each step rough."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.prior = prior_of(scene.flat)
        self.iterations = 0

    def run(self, theta: Theta) -> tuple[Theta, Noise]:
        """First Huber's loss, which finds the way from afar; then the redescending one, and the likeliest sigma."""
        scene = self.scene
        theta = self._roughly(replace(scene.white(FIRST_MPS2), tail=0.0), theta)
        sigma = 0.0
        sigmas = HAND_MPS2 if scene.rests_often else WHITE_MPS2
        for _ in range(2):
            sigma = _likeliest(scene.white, sigmas, theta)
            theta = self._roughly(scene.white(sigma), theta)
        if sigma == 0.0:
            return theta, Noise("none", 0.0)
        noise = Noise("white", sigma)
        if not scene.rests_often:
            sigma = _likeliest(scene.pivot, PIVOT_MPS2, theta)
            theta = self._roughly(scene.pivot(sigma), theta)
            sigma = _likeliest(scene.pivot, PIVOT_MPS2, theta)
            noise = Noise("pivot", (FARTHER + FARTHER_STILL * sigma) * sigma)
        for _ in range(PASSES):
            theta = self._roughly(_moved(noise.problem(scene), scene, theta), theta)
        return theta, noise

    def _roughly(self, problem: Problem, theta: Theta) -> Theta:
        minimum = _roughly(problem, theta, self.prior)
        self.iterations += minimum.iterations
        return minimum.theta


def _roughly(problem: Problem, theta: Theta, prior: Prior, fixed: tuple[str, ...] = ()) -> Minimum:
    return minimise(problem, theta, len(NAMES), prior, fixed, until=ROUGHLY, most=MOST_ROUGHLY, frozen=True)


def _likeliest(problem_of: Callable[[float], Problem], sigmas: tuple[float, ...], theta: Theta) -> float:
    """The sigma of least V at theta."""
    return min(sigmas, key=lambda sigma: value(problem_of(sigma), theta))


def near(sigma: float) -> tuple[float, ...]:
    """The neighbours of a sigma on the grid, itself among them, zero excepted."""
    at = WHITE_MPS2.index(sigma)
    return WHITE_MPS2[max(at - 1, 1) : at + 3]
