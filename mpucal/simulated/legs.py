"""Legs: the pieces a hand's motion is made of, each between two steps of the fine clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..data import Vector
from . import rotation

STEP_HZ = 2000
STEP_S = 1.0 / STEP_HZ

RAMP_S = 0.4


def steps(seconds: float) -> int:
    """Steps of the fine clock, rounded."""
    return round(seconds * STEP_HZ)


@dataclass(frozen=True)
class Leg:
    """A piece of motion from step `first` to step `last`; this one, in the hand, does nothing but tremble."""

    first: int
    last: int

    def turns(self, nodes: Vector) -> Vector:
        """(n, 3) rad turned between the (n + 1,) nodes [steps], in the board's axes."""
        return np.zeros((len(nodes) - 1, 3))

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """The quaternions (n + 1, 4) from `start` (4,) on."""
        return np.tile(start, (len(turns) + 1, 1))

    def effort(self, nodes: Vector) -> Vector:
        """(n + 1,) 0..1, how much the hand accelerates the board as it moves it."""
        return np.zeros(len(nodes))

    def grip(self, nodes: Vector) -> Vector:
        """(n + 1,) how much of the hand's tremor reaches the board: 1 in the hand, 0 on the table."""
        return np.ones(len(nodes))

    def cut(self, step: int) -> Self:
        """The same leg, ended at `step` or as soon after it as it can."""
        return replace(self, last=min(self.last, max(step, self.first)))


@dataclass(frozen=True)
class Hold(Leg):
    """As still as it is held: 1 in the hand, 0 on the table."""

    held: float

    def grip(self, nodes: Vector) -> Vector:
        """As held."""
        return np.full(len(nodes), self.held)


@dataclass(frozen=True)
class Move(Leg):
    """A turn by `turn_rad` (3,) with minimum jerk, from one grip to another; a hand finishes it."""

    turn_rad: Vector
    held: tuple[float, float]

    def turns(self, nodes: Vector) -> Vector:
        """Shares of the turn."""
        return np.diff(self._share(nodes))[:, None] * self.turn_rad

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """Turned about one axis."""
        turned = np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0)))
        return rotation.product(start, rotation.exp(turned))

    def effort(self, nodes: Vector) -> Vector:
        """Smoothly up and down again."""
        return _window(nodes, self.first, self.last)

    def grip(self, nodes: Vector) -> Vector:
        """From the first to the second."""
        before, after = self.held
        return before + (after - before) * self._share(nodes)

    def cut(self, step: int) -> Self:
        """Goes on to its end."""
        return self

    def _share(self, nodes: Vector) -> Vector:
        return minimum_jerk((nodes - self.first) / (self.last - self.first))


@dataclass(frozen=True)
class Tumble(Leg):
    """Rates that vary all the time: sums of k sines, each (3, k) of amplitude, pulsation and phase."""

    amplitude_rad_s: Vector
    pulsation_rad_s: Vector
    phase_rad: Vector

    def turns(self, nodes: Vector) -> Vector:
        """The rates at the middle of each step."""
        middle = (nodes[1:] + nodes[:-1]) / 2
        angle = self.pulsation_rad_s[:, :, None] * (middle * STEP_S) + self.phase_rad[:, :, None]
        rates = np.einsum("ak,akn->na", self.amplitude_rad_s, np.sin(angle))
        return np.asarray(rates * _window(middle, self.first, self.last)[:, None] * STEP_S)

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """One turn after the other."""
        return rotation.running_product(start, rotation.exp(turns))

    def effort(self, nodes: Vector) -> Vector:
        """Full, with a ramp at each end."""
        return _window(nodes, self.first, self.last)

    def cut(self, step: int) -> Self:
        """Slows down from `step` on."""
        begin = max(step, self.first + steps(RAMP_S))
        return replace(self, last=min(self.last, begin + steps(RAMP_S)))


def minimum_jerk(share: Vector) -> Vector:
    """0..1 of 0..1 with no speed or acceleration at the ends (Flash and Hogan 1985)."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s * s * s * (10 - 15 * s + 6 * s * s))


def minimum_jerk_rate(share: Vector) -> Vector:
    """Its derivative."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(30.0 * s * s * (1.0 - s) ** 2)


def _window(nodes: Vector, first: int, last: int) -> Vector:
    """1 inside, smoothly 0 at both ends."""
    inside = np.minimum(nodes - first, last - nodes) * STEP_S / min(RAMP_S, (last - first) * STEP_S / 2)
    return minimum_jerk(inside)
