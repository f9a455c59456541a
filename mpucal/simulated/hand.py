"""Hands: what a person who hears prompts does with the board next, leg by leg."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..data import Vector
from . import rotation
from .legs import STEP_HZ, Hold, Leg, Move, steps
from .mishaps import Mishap

# Faster than this no person reacts; so motion is settled this far ahead.
REACTION_S = (0.5, 1.5)
MISS_RAD = math.radians(8.0)
MOVE_S = 1.6
PAUSE_S = 2.0
FLAT_DOWN = (0.0, 0.0, -1.0)
TURN_RAD = (math.radians(50.0), math.radians(130.0))
ON_THE_TABLE, IN_THE_HAND = 0.0, 1.0
# Halfway through the turning.
MISHAP_AFTER_S = 18.0


class HandPrompt(Protocol):
    """What a hand understands of a prompt."""

    @property
    def kind(self) -> str:
        """lay_flat, hold_still, rotate, verify or rest; a hand goes on as before at any other."""
        ...

    @property
    def down(self) -> tuple[float, float, float] | None:
        """The unit vector in the board's axes that is to point down, if one is wanted."""
        ...


@dataclass(frozen=True)
class Stance:
    """Where the board is as a leg ends: step of the fine clock, attitude quaternion (4,), how it is held."""

    step: int
    attitude: Vector
    held: float


class Hand:
    """What all hands share; a kind overrides what it does differently.

    Parameters
    ----------
    rng : makes it this person and no other.

    Attributes
    ----------
    mishap : what befalls the sensor meanwhile.
    """

    MISHAP: type[Mishap] = Mishap
    HELD = IN_THE_HAND
    HASTE = 1.0

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._nerves = rng.spawn(2)
        self._heard: deque[tuple[int, HandPrompt]] = deque()
        self._last: tuple[str, tuple[float, float, float] | None] | None = None
        self._leg: Leg = Hold(0, 0, IN_THE_HAND)
        self._wish = "hold_still"
        self._down: Vector | None = None
        self._moved = False
        self.mishap = self.MISHAP()

    def first_stance(self) -> Stance:
        """The board as it is picked up: somehow tilted."""
        tilt = self._rng.uniform(-0.5, 0.5, 3)
        return Stance(0, rotation.exp(tilt), IN_THE_HAND)

    def hear(self, prompt: HandPrompt, t_s: float) -> None:
        """Heard at `t_s`, obeyed a reaction time later; said twice, it is the same prompt."""
        said = (str(prompt.kind), prompt.down)
        if said == self._last:
            return
        self._last = said
        if prompt.kind == "rotate":
            self.mishap.begin(t_s + MISHAP_AFTER_S)
        obeyed = math.ceil((t_s + self._nerves.uniform(*REACTION_S)) * STEP_HZ)
        if self._heard:
            obeyed = max(obeyed, self._heard[-1][0])
        self._heard.append((obeyed, prompt))

    def leg(self, stance: Stance) -> Leg:
        """The leg that `stance` is in; a new one where the last has ended."""
        if self._heard:
            self._leg = self._leg.cut(self._heard[0][0])
        while self._leg.last <= stance.step:
            self._obey(stance.step)
            self._leg = self._next(stance)
        return self._leg

    def _obey(self, step: int) -> None:
        while self._heard and self._heard[0][0] <= step:
            prompt = self._heard.popleft()[1]
            kind, down = str(prompt.kind), prompt.down
            # who is told to be still while laying the board flat goes on laying it flat
            calm_on = kind == "hold_still" and down is None and self._wish in ("lay_flat", "rest")
            if kind in ("lay_flat", "hold_still", "rotate", "verify", "rest") and not calm_on:
                self._wish, self._moved = kind, False
                self._down = None if down is None else np.array(down)

    def _next(self, now: Stance) -> Leg:
        if self._wish in ("lay_flat", "rest"):
            return self.lay_flat(now)
        return self.rotate(now) if self._wish in ("rotate", "verify") else self.hold_still(now)

    def lay_flat(self, now: Stance) -> Leg:
        """Sets the board down, then leaves it alone."""
        if self._moved or (now.held == ON_THE_TABLE and self._wish == "rest"):
            return self.pause(now, PAUSE_S)
        self._moved = True
        down = np.array(FLAT_DOWN) if self._down is None else self._down
        return self.move(now, self.towards(now, down), ON_THE_TABLE)

    def hold_still(self, now: Stance) -> Leg:
        """Stays as it is, or as it is asked to."""
        if self._moved or self._down is None:
            return self.pause(now, PAUSE_S)
        self._moved = True
        return self.move(now, self.towards(now, self.missed(self._down)), IN_THE_HAND)

    def rotate(self, now: Stance) -> Leg:
        """Moves and pauses by turns, to wherever `aim` says."""
        self._moved = not self._moved
        if self._moved:
            return self.move(now, self.aim(now), self.HELD)
        return self.pause(now, PAUSE_S)

    def aim(self, now: Stance) -> Vector:
        """The turn (3,) [rad] of the next move."""
        raise NotImplementedError

    def pause(self, now: Stance, seconds: float) -> Leg:
        """As still as it is held."""
        return Hold(now.step, now.step + steps(seconds), now.held)

    def move(self, now: Stance, turn_rad: Vector, held: float) -> Leg:
        """A turn about a fixed axis; beyond 130 deg it takes longer."""
        longer = max(1.0, float(np.linalg.norm(turn_rad)) / TURN_RAD[1])
        seconds = MOVE_S * longer / self.HASTE * self._rng.uniform(0.9, 1.1)
        return Move(now.step, now.step + steps(seconds), turn_rad, (now.held, held))

    def towards(self, now: Stance, down: Vector, twist_rad: float = 0.0) -> Vector:
        """The turn (3,) [rad] that points `down` (3,) down, and by `twist_rad` about the vertical."""
        up = -down / np.linalg.norm(down)
        tilt = -rotation.shortest_turn(rotation.up_in_board(now.attitude), up)
        return rotation.log(rotation.product(rotation.exp(tilt), rotation.exp(up * twist_rad)))

    def missed(self, down: Vector) -> Vector:
        """`down` (3,), missed by up to 8 deg."""
        axis = np.cross(down, self._rng.normal(size=3))
        miss = axis / np.linalg.norm(axis) * MISS_RAD * math.sqrt(self._rng.uniform())
        quaternion = rotation.exp(miss)
        vector = np.concatenate(([0.0], down))
        return rotation.product(rotation.product(quaternion, vector), rotation.conjugate(quaternion))[1:]
