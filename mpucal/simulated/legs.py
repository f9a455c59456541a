"""Legs: the segments of a hand's motion, each between two steps of the 2 kHz clock."""

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
    """Return the number of steps, rounded."""
    return round(seconds * STEP_HZ)


@dataclass(frozen=True)
class Leg:
    """Segment of motion from step `first` to step `last`; this base holds the board in the hand, with tremor only."""

    first: int
    last: int

    def turns(self, nodes: Vector) -> Vector:
        """Return the rotation vectors (n, 3) [rad] between the (n + 1,) nodes [steps], in the board's axes."""
        return np.zeros((len(nodes) - 1, 3))

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """Return the quaternions (n + 1, 4) from `start` (4,) on."""
        return np.tile(start, (len(turns) + 1, 1))

    def effort(self, nodes: Vector) -> Vector:
        """Return (n + 1,) 0..1, the share of the hand's sway and jerks that reaches the board."""
        return np.zeros(len(nodes))

    def grip(self, nodes: Vector) -> Vector:
        """Return (n + 1,) the share of the hand's tremor that reaches the board: 1 in the hand, 0 on the table."""
        return np.ones(len(nodes))

    def cut(self, step: int) -> Self:
        """Return this leg, ended at `step` or as soon as possible after it."""
        return replace(self, last=min(self.last, max(step, self.first)))


@dataclass(frozen=True)
class Hold(Leg):
    """Leg without motion; `strength` is 1 in the hand, 0 on the table."""

    strength: float

    def grip(self, nodes: Vector) -> Vector:
        """Return `strength`."""
        return np.full(len(nodes), self.strength)


@dataclass(frozen=True)
class Move(Leg):
    """Leg that turns by `turn_rad` (3,) with minimum jerk, from one grip to another; it cannot be cut."""

    turn_rad: Vector
    strengths: tuple[float, float]

    def turns(self, nodes: Vector) -> Vector:
        """Return shares of the turn."""
        return np.diff(self._share(nodes))[:, None] * self.turn_rad

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """Return the attitudes turned about one axis."""
        turned = np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0)))
        return rotation.product(start, rotation.exp(turned))

    def effort(self, nodes: Vector) -> Vector:
        """Return a smooth window over the leg."""
        return _window(nodes, self.first, self.last)

    def grip(self, nodes: Vector) -> Vector:
        """Return the transition from the first grip to the second."""
        before, after = self.strengths
        return before + (after - before) * self._share(nodes)

    def cut(self, step: int) -> Self:
        """Return this leg: a hand finishes it."""
        return self

    def _share(self, nodes: Vector) -> Vector:
        return minimum_jerk((nodes - self.first) / (self.last - self.first))


@dataclass(frozen=True)
class Tumble(Leg):
    """Leg with rates that are sums of k sines: amplitude, pulsation and phase (3, k)."""

    amplitude_rad_s: Vector
    pulsation_rad_s: Vector
    phase_rad: Vector

    def turns(self, nodes: Vector) -> Vector:
        """Integrate the rates by the midpoint rule."""
        middle = (nodes[1:] + nodes[:-1]) / 2
        angle = self.pulsation_rad_s[:, :, None] * (middle * STEP_S) + self.phase_rad[:, :, None]
        rates = np.einsum("ak,akn->na", self.amplitude_rad_s, np.sin(angle))
        return np.asarray(rates * _window(middle, self.first, self.last)[:, None] * STEP_S)

    def attitudes(self, start: Vector, turns: Vector) -> Vector:
        """Return the running product of the turns."""
        return rotation.running_product(start, rotation.exp(turns))

    def effort(self, nodes: Vector) -> Vector:
        """Return 1 with a ramp at each end."""
        return _window(nodes, self.first, self.last)

    def cut(self, step: int) -> Self:
        """Return this leg with its final ramp from `step` on."""
        begin = max(step, self.first + steps(RAMP_S))
        return replace(self, last=min(self.last, begin + steps(RAMP_S)))


def minimum_jerk(share: Vector) -> Vector:
    """Return the course 0..1 of 0..1 without speed or acceleration at the ends (Flash and Hogan 1985)."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s * s * s * (10 - 15 * s + 6 * s * s))


def _window(nodes: Vector, first: int, last: int) -> Vector:
    """Return 1 inside, smoothly 0 at both ends."""
    inside = np.minimum(nodes - first, last - nodes) * STEP_S / min(RAMP_S, (last - first) * STEP_S / 2)
    return minimum_jerk(inside)
