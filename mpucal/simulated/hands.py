"""Kinds of hands: those that follow the guidance, those that ignore it, and careless ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import cycle

import numpy as np

from ..data import Vector
from ..session.aims import ALL_AROUND
from . import rotation
from .disturbance import knock, slip, warming
from .hand import IN_THE_HAND, ON_THE_TABLE, PAUSE_S, TURN_RAD, USUAL, Hand, Manner, Stance
from .legs import Leg, Move, Tumble, steps


class Guided(Hand):
    """Hand that turns to the requested orientation and waits there; without one it varies faces, edges and corners."""

    def __init__(self, rng: np.random.Generator, manner: Manner = USUAL) -> None:
        super().__init__(rng, manner)
        self._visited: list[Vector] = []

    def rotate(self, now: Stance) -> Leg:
        """Return a move to the requested orientation, then pauses; without one, own moves and pauses alternately."""
        if self._down is None or not self._moved:
            return super().rotate(now)
        return self.pause(now, PAUSE_S)

    def aim(self, now: Stance) -> Vector:
        """Return the turn to the requested orientation, or to the one farthest from those visited."""
        if self._down is not None:
            return self.turn_to(now, self.inaccurate(self._down), self._rng.uniform(-0.5, 0.5))
        down = -rotation.up_in_board(now.attitude)
        if not self._visited:
            self._visited.append(down)
        angle = np.arccos(np.clip(ALL_AROUND @ down, -1.0, 1.0))
        nearest = np.max(ALL_AROUND @ np.array(self._visited).T, axis=1)
        reachable = (angle > TURN_RAD[0]) & (angle < TURN_RAD[1] - 0.2)
        cost = nearest + self._rng.uniform(0.0, 0.2, len(nearest)) + np.where(reachable, 0.0, 10.0)
        place = ALL_AROUND[int(np.argmin(cost))]
        self._visited.append(place)
        return self._varied(now, self.inaccurate(place))

    def _varied(self, now: Stance, down: Vector) -> Vector:
        """Return a turn to `down` with a random twist about the vertical, of 50 to 130 deg in all if possible."""
        turn = self.turn_to(now, down)
        for twist in self._rng.uniform(-1.5, 1.5, 8):
            twisted = self.turn_to(now, down, float(twist))
            if TURN_RAD[0] <= np.linalg.norm(twisted) <= TURN_RAD[1]:
                return twisted
        return turn


class Wandering(Hand):
    """Hand that pauses in random orientations, whatever is requested."""

    def aim(self, now: Stance) -> Vector:
        """Return a turn by 50 to 130 deg about a random axis."""
        axis = self._rng.normal(size=3)
        return np.asarray(axis / np.linalg.norm(axis) * self._rng.uniform(*TURN_RAD))


class Repeating(Guided):
    """Hand that repeats earlier poses while verifying, the first two of them twice."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(rng)
        self._shown: list[Vector] = []
        self._again: Iterator[Vector] = iter(())
        self._arrived = True

    def rotate(self, now: Stance) -> Leg:
        """Return requested moves while rotating, and moves from one old pose to the next while verifying."""
        down = -rotation.up_in_board(now.attitude)
        if self._task == "verify":
            self._arrived = not self._arrived
            if self._arrived:
                return self.pause(now, PAUSE_S)
            return self.move(now, self.turn_to(now, self.inaccurate(next(self._again, down))), IN_THE_HAND)
        leg = super().rotate(now)
        if not isinstance(leg, Move) and not any(np.array_equal(down, pose) for pose in self._shown):
            self._shown.append(down)
            self._again = cycle((*self._shown[:2], *self._shown))
        return leg


class OneAxis(Wandering):
    """Hand that turns the board about its x axis only."""

    def aim(self, now: Stance) -> Vector:
        """Return a turn by 50 to 130 deg about x."""
        return np.array([self._rng.uniform(*TURN_RAD), 0.0, 0.0])


class Random(Hand):
    """Hand that turns the board all the time about every axis, whatever is requested."""

    SINES = 6
    RATE_RMS_RAD_S = math.radians(80.0)

    def rotate(self, now: Stance) -> Leg:
        """Return a tumble of six sines an axis at 0.08 to 0.7 Hz, 80 deg/s rms."""
        if now.grip == ON_THE_TABLE:
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
    """Hand that lays the board flat, and never moves it when told to rotate."""

    def rotate(self, now: Stance) -> Leg:
        """Return a pause."""
        return self.pause(now, PAUSE_S)


class Restless(Guided):
    """Hand that fidgets instead of pausing: the board is never still."""

    FIDGET_RAD = math.radians(12.0)

    def pause(self, now: Stance, seconds: float) -> Leg:
        """Return a small turn, in the hand."""
        turn = self._rng.uniform(-self.FIDGET_RAD, self.FIDGET_RAD, 3)
        return Move(now.step, now.step + steps(self._rng.uniform(0.3, 0.7)), turn, (now.grip, IN_THE_HAND))


HANDS: dict[str, Callable[[np.random.Generator], Hand]] = {
    "guided": Guided,
    # lets go of the board in each orientation
    "placing": partial(Guided, manner=Manner(grip=ON_THE_TABLE)),
    "random": Random,
    "wandering": Wandering,
    "repeating": Repeating,
    "still": Motionless,
    "restless": Restless,
    "one_axis": OneAxis,
    "hasty": partial(Guided, manner=Manner(speed=4.0)),
    # the mishap comes while it turns, instead of at the time of a fault
    "slipping": partial(Guided, manner=Manner(mishap=slip)),
    "knocking": partial(Guided, manner=Manner(mishap=knock)),
    "warming": partial(Guided, manner=Manner(mishap=warming)),
}
