"""Turns of a board of the families after it has lain flat: angular rates on a fine clock.

Each motion is a function of the clock's step and a generator, and draws a course; a span is the least and the most.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mpucal.data import Vector
from mpucal.simulated import rotation

Rng = np.random.Generator
Span = tuple[float, float]

FLAT_S = 10.0
# a hand begins and ends an unbroken motion within this
FADE_S = 1.0
# orientations that a person has in mind before choosing the one least like those shown
CANDIDATES = 4


@dataclass(frozen=True)
class Course:
    """omega (n, 3) rad/s in the body at the middle of each step of step_s; moving (n,) 0 to 1, how much it is moved."""

    step_s: float
    omega: Vector
    moving: Vector

    @property
    def t(self) -> Vector:
        """Return the middle of each step (n,) [s]."""
        return self.step_s * np.arange(0.5, len(self.omega))

    @property
    def after_flat(self) -> Vector:
        """Return (n,) 0 while the board lies flat at first, and 1 after."""
        return (self.t >= FLAT_S).astype(float)

    @property
    def holding(self) -> Vector:
        """Return (n,) 0 to 1, how much a hand holds it still."""
        return self.after_flat * (1.0 - self.moving)


Motion = Callable[[float, Rng], Course]


@dataclass(frozen=True)
class Leg:
    """A turn by the rotation vector turn_rad (3,) in the body within `seconds`, and a rest of `hold_s` after it."""

    turn_rad: Vector
    seconds: float
    hold_s: float


def minimum_jerk_rate(share: Vector) -> Vector:
    """Return the derivative of `minimum_jerk` of mpucal.simulated.legs."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(30.0 * s * s * (1.0 - s) ** 2)


def along(legs: Sequence[Leg], step_s: float, rate: Callable[[Vector], Vector] = minimum_jerk_rate) -> Course:
    """Return the course of legs, one after the other; `rate`: of the share of a turn (0 to 1) by that of time."""
    seconds = FLAT_S + sum(leg.seconds + leg.hold_s for leg in legs)
    n = round(seconds / step_s)
    omega, moving = np.zeros((n, 3)), np.zeros(n)
    start = FLAT_S
    for leg in legs:
        inside = slice(round(start / step_s), min(round((start + leg.seconds) / step_s), n))
        share = (np.arange(inside.start, inside.stop, dtype=np.float64) + 0.5 - start / step_s) * step_s / leg.seconds
        omega[inside] = rate(share)[:, None] * (leg.turn_rad / leg.seconds)
        moving[inside] = np.clip(8.0 * share * (1.0 - share), 0.0, 1.0)
        start += leg.seconds + leg.hold_s
    return Course(step_s, omega, moving)


def direction(rng: Rng) -> Vector:
    """Draw a unit vector (3,) in any direction."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def poses(
    step_s: float,
    rng: Rng,
    count: int = 12,
    turn_deg: Span = (50.0, 140.0),
    move_s: Span = (1.2, 2.2),
    hold_s: Span = (1.6, 2.8),
    back: bool = False,
) -> Course:
    """Draw still orientations, the flat one among them, each as unlike those before as a person thinks of.

    back : it is put down at last as it lay at first.
    """
    attitude, shown, legs = rotation.exp(np.zeros(3)), [np.array([0.0, 0.0, 1.0])], list[Leg]()
    for _ in range(count - 1):
        turns = [direction(rng) * np.radians(rng.uniform(*turn_deg)) for _ in range(CANDIDATES)]
        after = rotation.product(attitude, rotation.exp(np.array(turns)))
        up = rotation.up_in_board(after)
        best = int(np.argmin((up @ np.array(shown).T).max(axis=1)))
        attitude = after[best]
        shown.append(up[best])
        legs.append(Leg(turns[best], rng.uniform(*move_s), rng.uniform(*hold_s)))
    if back:
        legs.append(Leg(rotation.log(rotation.conjugate(attitude)), 3.0, 5.0))
    return along(legs, step_s)


def on_a_chair(
    step_s: float, rng: Rng, count: int = 9, spin_rad: Span = (2.0, 7.0), spin_s: Span = (3.0, 5.0)
) -> Course:
    """Draw still orientations, and after each the chair is turned, which gravity does not show."""
    attitude, legs = rotation.exp(np.zeros(3)), []
    for _ in range(count - 1):
        turn = direction(rng) * rng.uniform(0.9, 2.5)
        attitude = rotation.product(attitude, rotation.exp(turn))
        spin = rotation.up_in_board(attitude) * rng.choice([-1.0, 1.0]) * rng.uniform(*spin_rad)
        legs += [Leg(turn, 1.5, 1.0), Leg(spin, rng.uniform(*spin_s), 1.0)]
        attitude = rotation.product(attitude, rotation.exp(spin))
    return along(legs, step_s)


def continuous(
    step_s: float, rng: Rng, seconds: float = 45.0, rms_dps: float = 80.0, band_hz: Span = (0.08, 0.7)
) -> Course:
    """Draw turns all the time about every axis: Gaussian rates within band_hz, rms_dps an axis."""
    n = round((FLAT_S + seconds) / step_s)
    moving = begun(step_s * np.arange(0.5, n))
    return Course(step_s, np.radians(rms_dps) * moving[:, None] * band_noise(n, step_s, band_hz, rng), moving)


def begun(t: Vector) -> Vector:
    """Return (n,) 0 until the flat segment ends, and 1 from FADE_S later on."""
    share = np.clip((t - FLAT_S) / FADE_S, 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))


def spins(
    step_s: float,
    rng: Rng,
    about: tuple[int, ...] = (0, 1, 2, 0, 1, 2),
    oblique: int = 3,
    turn_deg: Span = (330.0, 520.0),
    turn_s: Span = (4.0, 7.0),
    pause_s: float = 1.0,
) -> Course:
    """Draw a turn or more about each of these axes of the board (0, 1, 2), and about `oblique` others."""
    axes = [rng.choice([-1.0, 1.0]) * np.eye(3)[axis] for axis in about]
    axes += [direction(rng) for _ in range(oblique)]
    turns = [np.radians(rng.uniform(*turn_deg)) * axis + rng.uniform(-0.15, 0.15, 3) for axis in axes]
    return along([Leg(turn, rng.uniform(*turn_s), pause_s) for turn in turns], step_s)


def arcs(
    step_s: float,
    rng: Rng,
    count: int = 6,
    rate_dps: Span = (3.0, 10.0),
    arc_deg: Span = (100.0, 180.0),
    pause_s: float = 0.0,
    ramp: float = 0.02,
) -> Course:
    """Draw turns of a machine at constant rates, about axes with components of -1, 0 and 1.

    ramp : the share of an arc that it takes to start, and to stop.
    """
    legs: list[Leg] = []
    last = np.zeros(3)
    while len(legs) < count:
        axis = rng.integers(-1, 2, 3).astype(float)
        if not np.any(np.cross(axis, last) if legs else axis):
            continue
        last = axis
        arc, rate = rng.uniform(*arc_deg), rng.uniform(*rate_dps)
        legs.append(Leg(np.radians(arc) * axis / np.linalg.norm(axis), arc / rate, pause_s))
    return along(legs, step_s, lambda share: trapezoid(share, ramp))


def trapezoid(share: Vector, ramp: float) -> Vector:
    """Return a rate that rises within `ramp` of the time, stays, and falls; of mean 1 over 0..1."""
    return np.asarray(np.clip(np.minimum(share, 1.0 - share) / ramp, 0.0, 1.0) / (1.0 - ramp))


def band_noise(n: int, step_s: float, band_hz: Span, rng: Rng) -> Vector:
    """Draw (n, 3) Gaussian noise between two frequencies, of rms 1 an axis."""
    frequency = np.fft.rfftfreq(n, step_s)
    band = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    spectrum = np.zeros((len(frequency), 3), complex)
    spectrum[band] = rng.standard_normal((band.sum(), 3)) + 1j * rng.standard_normal((band.sum(), 3))
    noise = np.fft.irfft(spectrum, n, axis=0)
    scaled: Vector = noise / np.sqrt((noise**2).mean(0))
    return scaled
