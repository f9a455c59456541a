"""Hands: what a person who hears prompts does with the board next, leg by leg."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import product as combinations
from typing import Protocol

import numpy as np

from ..data import Vector
from . import rotation
from .legs import STEP_HZ, Hold, Leg, Move, Tumble, steps
from .mishaps import Knock, Mishap, Slip, Warmth

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


class Guided(Hand):
    """Goes where it is asked to and waits there; asked for nothing, varies faces, edges and corners."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(rng)
        corners = np.array([c for c in combinations((-1.0, 0.0, 1.0), repeat=3) if any(c)])
        self._places = corners / np.linalg.norm(corners, axis=1, keepdims=True)
        self._visited: list[Vector] = []

    def rotate(self, now: Stance) -> Leg:
        """To the asked direction, or on to another of its own."""
        if self._down is None or not self._moved:
            return super().rotate(now)
        return self.pause(now, PAUSE_S)

    def aim(self, now: Stance) -> Vector:
        """To the asked direction, else to the one least like those visited."""
        if self._down is not None:
            return self.towards(now, self.missed(self._down), self._rng.uniform(-0.5, 0.5))
        down = -rotation.up_in_board(now.attitude)
        if not self._visited:
            self._visited.append(down)
        angle = np.arccos(np.clip(self._places @ down, -1.0, 1.0))
        nearest = np.max(self._places @ np.array(self._visited).T, axis=1)
        reachable = (angle > TURN_RAD[0]) & (angle < TURN_RAD[1] - 0.2)
        cost = nearest + self._rng.uniform(0.0, 0.2, len(nearest)) + np.where(reachable, 0.0, 10.0)
        place = self._places[int(np.argmin(cost))]
        self._visited.append(place)
        return self._varied(now, self.missed(place))

    def _varied(self, now: Stance, down: Vector) -> Vector:
        """A turn to `down` with as much twist about the vertical as 50 to 130 deg leave room for."""
        turn = self.towards(now, down)
        for twist in self._rng.uniform(-1.5, 1.5, 8):
            twisted = self.towards(now, down, float(twist))
            if TURN_RAD[0] <= np.linalg.norm(twisted) <= TURN_RAD[1]:
                return twisted
        return turn


class Placing(Guided):
    """Sets the board down on something in each orientation, and lets go of it."""

    HELD = ON_THE_TABLE


class Wandering(Guided):
    """Pauses as others do, but in any orientation, whatever it is asked for."""

    def aim(self, now: Stance) -> Vector:
        """Anywhere."""
        axis = self._rng.normal(size=3)
        return np.asarray(axis / np.linalg.norm(axis) * self._rng.uniform(*TURN_RAD))

    def rotate(self, now: Stance) -> Leg:
        """Moves and pauses by turns."""
        return Hand.rotate(self, now)


class OneAxis(Wandering):
    """Turns the board about its x axis alone."""

    def aim(self, now: Stance) -> Vector:
        """On, by as much as others turn."""
        return np.array([self._rng.uniform(*TURN_RAD), 0.0, 0.0])


class Hasty(Guided):
    """Follows as others do, four times as fast."""

    HASTE = 4.0


class Slipping(Guided):
    """Holds the board by its sensor, whose accelerometer slips on its mount."""

    MISHAP = Slip


class Knocking(Guided):
    """Knocks the board against something."""

    MISHAP = Knock


class Warming(Guided):
    """Stands in the sun."""

    MISHAP = Warmth


class Random(Hand):
    """Turns the board all the time, about every axis at once, whatever direction it is asked for."""

    SINES = 6
    RATE_RMS_RAD_S = math.radians(80.0)

    def rotate(self, now: Stance) -> Leg:
        """Six sines an axis at 0.08 to 0.7 Hz, 80 deg/s rms."""
        if now.held == ON_THE_TABLE:
            return self.move(now, self._rng.uniform(-0.3, 0.3, 3), IN_THE_HAND)
        shape = (3, self.SINES)
        return Tumble(
            now.step,
            now.step + steps(3600.0),
            np.full(shape, self.RATE_RMS_RAD_S * math.sqrt(2 / self.SINES)),
            2 * np.pi * self._rng.uniform(0.08, 0.7, shape),
            self._rng.uniform(0.0, 2 * np.pi, shape),
        )


class Motionless(Hand):
    """Lays the board flat, and never moves it when told to rotate."""

    def rotate(self, now: Stance) -> Leg:
        """Does not."""
        return self.pause(now, PAUSE_S)


class Restless(Guided):
    """Fidgets where others pause: the board never lies still."""

    FIDGET_RAD = math.radians(12.0)

    def pause(self, now: Stance, seconds: float) -> Leg:
        """A small turn, in the hand."""
        turn = self._rng.uniform(-self.FIDGET_RAD, self.FIDGET_RAD, 3)
        return Move(now.step, now.step + steps(self._rng.uniform(0.3, 0.7)), turn, (now.held, IN_THE_HAND))


KINDS: dict[str, type[Hand]] = {
    "guided": Guided,
    "placing": Placing,
    "random": Random,
    "wandering": Wandering,
    "still": Motionless,
    "restless": Restless,
    "one_axis": OneAxis,
    "hasty": Hasty,
    "slipping": Slipping,
    "knocking": Knocking,
    "warming": Warming,
}
