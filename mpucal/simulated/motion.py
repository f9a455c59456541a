"""Motion of the board in a hand: integrated at 2 kHz as far as it is asked for, averaged over any span."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from ..data import Vector
from ..mavlink.texts import Prompt
from . import rotation
from .disturbance import (
    ARMS,
    HELD_HZ,
    JERK_MPS2,
    JERK_S,
    SWAY_HZ,
    USUAL_ARM,
    HandDisturbance,
    Mishap,
    point_acceleration,
)
from .hand import REACTION_S, Hand, Stance
from .legs import STEP_HZ, STEP_S, Hold, Leg, steps

# Shorter than any reaction: of the motion that has been computed, a prompt changes only a pause.
AHEAD_S = 0.9 * REACTION_S[0]

SINES = 12
# A sum of sines is computed for this many steps at once, whose phases differ from those of the first by fixed angles.
BLOCK = 128


class BandNoise:
    """Band-limited noise on three axes, as a sum of sines.

    Parameters
    ----------
    band_hz : lowest and highest frequency. rms : of each axis.
    """

    def __init__(self, rng: np.random.Generator, band_hz: tuple[float, float], rms: float) -> None:
        self._pulsation = 2 * np.pi * rng.uniform(*band_hz, (3, SINES))
        self._phase = rng.uniform(0.0, 2 * np.pi, (3, SINES))
        self._amplitude = rms * np.sqrt(2 / SINES)
        angle = self._pulsation[:, :, None] * np.arange(BLOCK) * STEP_S
        self._waves = np.concatenate((np.cos(angle), np.sin(angle)), axis=1)

    def at(self, first: int, n: int) -> Vector:
        """Return (n, 3) at the steps from `first` on."""
        return self._sum(*self._phases(first, n), n)

    def integral(self, first: int, n: int) -> Vector:
        """Return (n, 3) the integral over time, without its mean, at the steps from `first` on."""
        sine, cosine = self._phases(first, n)
        return self._sum(-cosine / self._pulsation[:, None], sine / self._pulsation[:, None], n)

    def second_derivative(self, first: int, n: int) -> Vector:
        """Return (n, 3) the second derivative by time at the steps from `first` on."""
        sine, cosine = self._phases(first, n)
        square = self._pulsation[:, None] ** 2
        return self._sum(-square * sine, -square * cosine, n)

    def _phases(self, first: int, n: int) -> tuple[Vector, Vector]:
        """Return sine and cosine (3, k, SINES) at the first step of each block."""
        begin_s = np.arange(first, first + n, BLOCK)[:, None] * STEP_S
        angle = self._pulsation[:, None] * begin_s + self._phase[:, None]
        return np.sin(angle), np.cos(angle)

    def _sum(self, cosines: Vector, sines: Vector, n: int) -> Vector:
        weights = np.concatenate((cosines, sines), axis=2) * self._amplitude
        return np.asarray((weights @ self._waves).reshape(3, -1)[:, :n].T)


class Jerk(NamedTuple):
    """A jerk: half a sine of `peak_mps2` (3,) that starts at `start_s`."""

    start_s: float
    seconds: float
    peak_mps2: Vector

    @classmethod
    def draw(cls, rng: np.random.Generator, start_s: float) -> Self:
        """Draw one in a random direction."""
        direction = rng.normal(size=3)
        peak = direction / np.linalg.norm(direction) * rng.uniform(*JERK_MPS2)
        return cls(start_s, rng.uniform(*JERK_S), peak)

    @property
    def end_s(self) -> float:
        """Time of its end."""
        return self.start_s + self.seconds

    def at(self, t_s: Vector) -> Vector:
        """Return (n, 3) m/s^2 at times (n,)."""
        share = np.clip((t_s - self.start_s) / self.seconds, 0.0, 1.0)
        return np.sin(np.pi * share)[:, None] * self.peak_mps2


class Motion:
    """Motion of the board: its attitude, specific force and rate.

    It is integrated at 2 kHz; the turn between two steps is the logarithm of the attitude's change, so that
    rates integrate to the attitude.

    Parameters
    ----------
    hand : decides on the legs. rng : of the hand's tremor, lever and jerks. gravity : m/s^2.
    mishaps : of the sensor, besides the hand's own. disturbance : amplitudes of the hand's tremor, sway and jerks; a
        person draws 50 to 100 % of the tremor's acceleration.

    Attributes
    ----------
    mishaps : those of the hand and of the sensor.
    """

    def __init__(
        self,
        hand: Hand,
        rng: np.random.Generator,
        gravity: float,
        mishaps: Iterable[Mishap] = (),
        disturbance: HandDisturbance = ARMS[USUAL_ARM],
    ) -> None:
        self._hand = hand
        self.mishaps = tuple(mishap for mishap in (hand.mishap, *mishaps) if mishap is not None)
        self._gravity, self._disturbance = gravity, disturbance
        lever = rng.normal(size=3)
        self._lever_m = lever / np.linalg.norm(lever) * rng.uniform(*disturbance.lever_m)
        self._tremor_force = BandNoise(rng, disturbance.tremor_hz, disturbance.tremor_mps2 * rng.uniform(0.5, 1.0))
        self._tremor_rate = BandNoise(rng, disturbance.tremor_hz, disturbance.tremor_rad_s)
        self._sway = BandNoise(rng, SWAY_HZ, disturbance.sway_mps2)
        self._jerk_rng, of_place, of_angle = rng.spawn(3)
        self._held_place = BandNoise(of_place, HELD_HZ, disturbance.held_m)
        self._held_angle = BandNoise(of_angle, HELD_HZ, disturbance.held_rad)
        self._stance = hand.first_stance()
        self._rate = np.zeros(3)
        self._jerks: list[Jerk] = []
        self._first = 0
        self._sums = np.zeros((1, 6))
        self._attitudes = self._shaken(self._stance.attitude[None], 0, np.ones(1))

    def hear(self, prompt: Prompt, t_s: float) -> None:
        """Pass a prompt to the hand at `t_s`; the rest of a pause that it ends is computed again."""
        had_prompts = self._hand.has_prompts
        self._hand.hear(prompt, t_s)
        if not had_prompts and (last := self._hand.cut().last) < self._stance.step:
            self._stance = self._stance._replace(step=last)
            nodes = last - self._first + 1
            self._sums, self._attitudes = self._sums[:nodes], self._attitudes[:nodes]

    def means(self, edges_s: Vector, force_late_s: float = 0.0) -> tuple[Vector, Vector]:
        """Return mean specific force (n, 3) [m/s^2] and rate (n, 3) [rad/s] between (n + 1,) increasing times [s].

        The motion before the last edge is dropped then.

        Parameters
        ----------
        force_late_s : delay of the force against the rate; negative: of the rate.
        """
        self._extend(float(edges_s[-1]))
        n = len(edges_s)
        times_s = np.concatenate((edges_s, edges_s - abs(force_late_s))) if force_late_s else edges_s
        sums, node = self._sums_at(times_s)
        means = (sums[1:] - sums[:-1]) / (times_s[1:] - times_s[:-1])[:, None]
        force, rate = means[: n - 1, :3], means[: n - 1, 3:]
        if force_late_s > 0.0:
            force = means[n:, :3]
        elif force_late_s:
            rate = means[n:, 3:]
        self._forget(node)
        for mishap in self.mishaps:
            force, rate = mishap.apply(force, rate, edges_s[1:])
        return force, rate

    def _sums_at(self, t_s: Vector) -> tuple[Vector, int]:
        """Return the integrals of force and rate (n, 6) until times (n,) [s], and the step before the last of these."""
        place = np.maximum(t_s * STEP_HZ - self._first, 0.0)
        node = np.minimum(place.astype(int), len(self._sums) - 2)
        part = (place - node)[:, None]
        return np.asarray((1 - part) * self._sums[node] + part * self._sums[node + 1]), int(node[-1])

    def warmer_c(self, edges_s: Vector) -> Vector:
        """Return (n,) degrees Celsius by which the chip is warmer than at first, between (n + 1,) times [s]."""
        return np.asarray(sum((mishap.warmer_c(edges_s[1:]) for mishap in self.mishaps), np.zeros(len(edges_s) - 1)))

    def attitude(self, t_s: float) -> Vector:
        """Return the quaternion (4,) at `t_s`, which is not before the last edge given to `means`."""
        self._extend(t_s)
        place = t_s * STEP_HZ - self._first
        node = min(int(place), len(self._attitudes) - 2)
        near = self._attitudes[node : node + 2]
        return rotation.product(near[0], rotation.exp((place - node) * rotation.between(near)[0]))

    def _extend(self, t_s: float) -> None:
        if self._stance.step > t_s * STEP_HZ:
            return
        sums, attitudes = [self._sums], [self._attitudes]
        while self._stance.step <= t_s * STEP_HZ:
            motion, more = self._next_steps()
            sums.append(sums[-1][-1] + np.cumsum(motion, axis=0))
            attitudes.append(more)
        self._sums, self._attitudes = np.concatenate(sums), np.concatenate(attitudes)

    def _forget(self, nodes: int) -> None:
        self._first += nodes
        self._sums = self._sums[nodes:]
        self._attitudes = self._attitudes[nodes:]

    def _next_steps(self) -> tuple[Vector, Vector]:
        """Return force and rate (n, 6) of the next AHEAD_S, or until a leg ends, and the attitudes (n, 4).

        A leg that cannot be cut is computed to its end, and so is a pause, unless a prompt is known to cut it.
        """
        leg = self._hand.leg(self._stance)
        first = self._stance.step
        whole = leg.cut(first) is leg or (isinstance(leg, Hold) and not self._hand.has_prompts)
        last = leg.last if whole else min(leg.last, first + steps(AHEAD_S))
        nodes = np.arange(first, last + 1, dtype=float)
        turns, grip = leg.turns(nodes), leg.grip(nodes)
        planned = leg.attitudes(self._stance.attitude, turns)
        attitudes = self._shaken(planned, first, grip)
        up = rotation.up_in_board(attitudes)
        force = self._gravity * (up[1:] + up[:-1]) / 2
        force += self._lever_force(turns / STEP_S) + self._shaking(leg, nodes, grip)
        self._stance = Stance(last, planned[-1], float(grip[-1]))
        return np.hstack((force * STEP_S, rotation.between(attitudes))), attitudes[1:]

    def _shaken(self, planned: Vector, first: int, grip: Vector) -> Vector:
        """Return the planned attitudes (n, 4) with the hand's tremor and sway."""
        if not grip.any():
            return planned
        turned = self._tremor_rate.integral(first, len(grip))
        if self._disturbance.held_rad:
            turned += self._held_angle.at(first, len(grip))
        return rotation.product(planned, rotation.exp(turned * grip[:, None]))

    def _lever_force(self, rates: Vector) -> Vector:
        """Return the acceleration (n, 3) on the lever r at (n, 3) rad/s: alpha x r + w x (w x r)."""
        if not (rates.any() or self._rate.any()):
            return np.zeros_like(rates)
        alpha = np.diff(rates, axis=0, prepend=self._rate[None]) / STEP_S
        self._rate = rates[-1]
        return point_acceleration(alpha, rates, self._lever_m)

    def _shaking(self, leg: Leg, nodes: Vector, grip: Vector) -> Vector:
        """Return the hand's own acceleration (n, 3) in each step: tremor, sway and jerks."""
        first, t_s = int(nodes[0]), nodes[1:] * STEP_S
        effort = leg.effort(nodes)[1:, None]
        push = np.zeros((len(t_s), 3))
        if grip.any():
            shaken = self._tremor_force.at(first, len(t_s))
            if self._disturbance.held_m:
                shaken += self._held_place.second_derivative(first, len(t_s))
            push += shaken * grip[1:, None]
        if effort.any():
            push += self._sway.at(first, len(t_s)) * effort
            for begin in range(0, len(t_s), steps(AHEAD_S)):
                part_s = t_s[begin : begin + steps(AHEAD_S)]
                for _ in range(self._jerk_rng.poisson(self._disturbance.jerks_per_s * len(part_s) * STEP_S)):
                    self._jerks.append(Jerk.draw(self._jerk_rng, float(self._jerk_rng.uniform(part_s[0], part_s[-1]))))
        for jerk in self._jerks:
            push += jerk.at(t_s)
        self._jerks = [jerk for jerk in self._jerks if jerk.end_s > t_s[-1]]
        return push
