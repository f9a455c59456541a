"""Hands: a simulated operator, who obeys prompts and moves the board leg by leg."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from ..calibration.rotation import shortest_turns
from ..data import Vector
from ..mavlink.texts import Prompt
from . import rotation
from .disturbance import Change, Mishap
from .legs import STEP_HZ, Hold, Leg, Move, steps

# Nobody reacts faster, so the motion is fixed this far ahead.
REACTION_S = (0.5, 1.5)
MISS_RAD = math.radians(8.0)
MOVE_S = 1.6
PAUSE_S = 2.0
TURN_RAD = (math.radians(50.0), math.radians(130.0))
ON_THE_TABLE, IN_THE_HAND = 0.0, 1.0


class Stance(NamedTuple):
    """State of the board at the end of a leg: step of the 2 kHz clock, attitude quaternion (4,), grip 0..1."""

    step: int
    attitude: Vector
    grip: float


class Manner(NamedTuple):
    """Manner of a hand.

    Attributes
    ----------
    grip : with which it pauses in an orientation. speed : of its moves, relative to the usual.
    mishap : change of the sensor while it turns.
    """

    grip: float = IN_THE_HAND
    speed: float = 1.0
    mishap: Change | None = None


USUAL = Manner()


class Hand:
    """Base of all hands; a kind overrides the behaviour in which it differs.

    Parameters
    ----------
    rng : of this person's choices.

    Attributes
    ----------
    mishap : of the sensor in this hand; None: there is none.
    """

    def __init__(self, rng: np.random.Generator, manner: Manner = USUAL) -> None:
        self._rng, self._reaction_rng = rng.spawn(2)
        self._manner = manner
        self._prompts: deque[tuple[int, Prompt]] = deque()
        self._last: tuple[str, tuple[float, float, float] | None] | None = None
        self._leg: Leg = Hold(0, 0, IN_THE_HAND)
        self._task = "hold_still"
        self._down: Vector | None = None
        self._moved = False
        self.mishap = None if manner.mishap is None else Mishap(manner.mishap)

    def first_stance(self) -> Stance:
        """Return the board as it is picked up, with a random tilt."""
        tilt = self._rng.uniform(-0.5, 0.5, 3)
        return Stance(0, rotation.exp(tilt), IN_THE_HAND)

    def hear(self, prompt: Prompt, t_s: float) -> None:
        """Receive a prompt at `t_s`, to be obeyed a reaction time later; a repeated prompt is ignored."""
        received = (str(prompt.kind), prompt.down)
        if received == self._last:
            return
        self._last = received
        if prompt.kind == "rotate" and self.mishap is not None:
            # halfway through the rotation
            self.mishap.begin(t_s + 18.0)
        obeyed = math.ceil((t_s + self._reaction_rng.uniform(*REACTION_S)) * STEP_HZ)
        if self._prompts:
            obeyed = max(obeyed, self._prompts[-1][0])
        self._prompts.append((obeyed, prompt))

    @property
    def has_prompts(self) -> bool:
        """True if it will obey a prompt that it has heard."""
        return bool(self._prompts)

    def cut(self) -> Leg:
        """Cut the present leg where the next prompt is obeyed, if there is one, and return it."""
        if self._prompts:
            self._leg = self._leg.cut(self._prompts[0][0])
        return self._leg

    def leg(self, stance: Stance) -> Leg:
        """Return the leg that `stance` is in, a new one if the last has ended."""
        self.cut()
        while self._leg.last <= stance.step:
            self._obey(stance.step)
            self._leg = self._next(stance)
        return self._leg

    def _obey(self, step: int) -> None:
        while self._prompts and self._prompts[0][0] <= step:
            prompt = self._prompts.popleft()[1]
            kind, down = str(prompt.kind), prompt.down
            # A board that is being laid flat is held still by laying it flat.
            goes_on = kind == "hold_still" and down is None and self._task in ("lay_flat", "rest")
            if kind in ("lay_flat", "hold_still", "rotate", "verify", "rest") and not goes_on:
                self._task, self._moved = kind, False
                self._down = None if down is None else np.array(down)

    def _next(self, now: Stance) -> Leg:
        if self._task in ("lay_flat", "rest"):
            return self.lay_flat(now)
        return self.rotate(now) if self._task in ("rotate", "verify") else self.hold_still(now)

    def lay_flat(self, now: Stance) -> Leg:
        """Return a leg that sets the board down, then pauses."""
        if self._moved or (now.grip == ON_THE_TABLE and self._task == "rest"):
            return self.pause(now, PAUSE_S)
        self._moved = True
        down = np.array([0.0, 0.0, -1.0]) if self._down is None else self._down
        return self.move(now, self.turn_to(now, down), ON_THE_TABLE)

    def hold_still(self, now: Stance) -> Leg:
        """Return a leg to the requested orientation, if there is one, then pauses."""
        if self._moved or self._down is None:
            return self.pause(now, PAUSE_S)
        self._moved = True
        return self.move(now, self.turn_to(now, self.inaccurate(self._down)), IN_THE_HAND)

    def rotate(self, now: Stance) -> Leg:
        """Return moves and pauses alternately; `aim` gives each move."""
        self._moved = not self._moved
        if self._moved:
            return self.move(now, self.aim(now), self._manner.grip)
        return self.pause(now, PAUSE_S)

    def aim(self, now: Stance) -> Vector:
        """Return the rotation vector (3,) [rad] of the next move."""
        raise NotImplementedError

    def pause(self, now: Stance, seconds: float) -> Leg:
        """Return a leg without motion, with the present grip."""
        return Hold(now.step, now.step + steps(seconds), now.grip)

    def move(self, now: Stance, turn_rad: Vector, grip: float) -> Leg:
        """Return a leg that turns the board about a fixed axis; beyond 130 deg it takes longer."""
        longer = max(1.0, float(np.linalg.norm(turn_rad)) / TURN_RAD[1])
        seconds = MOVE_S * longer / self._manner.speed * self._rng.uniform(0.9, 1.1)
        return Move(now.step, now.step + steps(seconds), turn_rad, (now.grip, grip))

    def turn_to(self, now: Stance, down: Vector, twist_rad: float = 0.0) -> Vector:
        """Return the rotation vector (3,) [rad] that points `down` (3,) down, with a twist about the vertical."""
        up = -down / np.linalg.norm(down)
        (tilt,) = -shortest_turns(rotation.up_in_board(now.attitude)[None], up[None])
        return rotation.log(rotation.product(rotation.exp(tilt), rotation.exp(up * twist_rad)))

    def inaccurate(self, down: Vector) -> Vector:
        """Return `down` (3,), wrong by up to 8 deg."""
        axis = np.cross(down, self._rng.normal(size=3))
        miss = axis / np.linalg.norm(axis) * MISS_RAD * math.sqrt(self._rng.uniform())
        quaternion = rotation.exp(miss)
        vector = np.concatenate(([0.0], down))
        return rotation.product(rotation.product(quaternion, vector), rotation.conjugate(quaternion))[1:]
