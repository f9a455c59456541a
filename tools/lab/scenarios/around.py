"""Motions of a board besides its turns: of the hand that holds it, and of the place, such as a boat or an elevator.

Each of the latter is a function of the course and a generator: (n, 3) m/s^2 of the pivot in the world, z up, and (n, 3)
rad/s in the body; 0.0 for none.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.simulated.disturbance import JERK_MPS2, SWAY_HZ, TREMOR_HZ, HandDisturbance
from mpucal.simulated.legs import minimum_jerk

from .course import FLAT_S, Course, Rng, Span, band_noise, direction

PIVOT_HZ = (0.05, 0.4)
Push = tuple[Vector | float, Vector | float]
Around = Callable[[Course, Rng], Push]


@dataclass(frozen=True)
class Hand(HandDisturbance):
    """A hand with the sensor on a lever.

    Attributes
    ----------
    jerk_s : least and greatest duration of a jerk. passes : times that the pivot changes place, as between two hands.
    """

    lever_m: Span = (0.1, 0.3)
    jerk_s: Span = (0.05, 0.15)
    passes: int = 0

    def lever(self, course: Course, rng: Rng) -> Vector:
        """Return the sensor's place from the pivot (n, 3) [m], in the body."""
        n, along, length = len(course.omega), direction(rng), rng.uniform(*self.lever_m)
        # an rms of wobble * length over three axes
        travel = self.wobble * length / np.sqrt(3.0) * band_noise(n, course.step_s, PIVOT_HZ, rng)
        r = length * along + course.moving[:, None] * travel
        for at in rng.uniform(FLAT_S, course.t[-1], self.passes):
            share = minimum_jerk((course.t - at) / 0.6)
            r += share[:, None] * rng.uniform(*self.lever_m) * direction(rng)
        return np.asarray(r)

    def acceleration(self, course: Course, rng: Rng) -> Vector:
        """Return sway and jerks while it moves, and tremor while it holds (n, 3) [m/s^2], in the body."""
        n, step_s = len(course.omega), course.step_s
        a = self.sway_mps2 * course.moving[:, None] * band_noise(n, step_s, SWAY_HZ, rng)
        for start in np.flatnonzero(rng.random(n) < self.jerks_per_s * step_s * course.moving).tolist():
            length = min(int(rng.uniform(*self.jerk_s) / step_s), n - start)
            peak = direction(rng) * rng.uniform(*JERK_MPS2)
            a[start : start + length] += np.sin(np.pi * (np.arange(length) + 0.5) / max(length, 1))[:, None] * peak
        return np.asarray(a + self.tremor_mps2 * course.holding[:, None] * band_noise(n, step_s, TREMOR_HZ, rng))

    def tremor(self, course: Course, rng: Rng) -> Vector:
        """Return the rates (n, 3) [rad/s] of the tremor."""
        noise = band_noise(len(course.omega), course.step_s, TREMOR_HZ, rng)
        return np.asarray(self.tremor_rad_s * course.holding[:, None] * noise)


def walking(course: Course, rng: Rng, bounce_mps2: float = 1.0) -> Push:
    """Walk after the flat segment, in steps at about 2 Hz, with a second harmonic and a cadence that wanders.

    bounce_mps2 : up and down; half of it goes sideways at half the rate.
    """
    cadence = 2.0 * (1.0 + 0.05 * band_noise(len(course.omega), course.step_s, (0.05, 0.3), rng)[:, 0])
    phase = 2 * np.pi * np.cumsum(cadence) * course.step_s
    a = np.empty((len(phase), 3))
    a[:, 0] = 0.3 * np.sin(phase + rng.uniform(0, 6.28))
    a[:, 1] = 0.5 * np.sin(phase / 2 + rng.uniform(0, 6.28))
    a[:, 2] = np.sin(phase) + 0.3 * np.sin(2 * phase + rng.uniform(0, 6.28))
    return bounce_mps2 * course.after_flat[:, None] * a, 0.0


def vibration(
    course: Course,
    rng: Rng,
    rms_mps2: float = 1.0,
    band_hz: Span = (20.0, 80.0),
    dps: float = 0.5,
    flat_too: bool = False,
) -> Push:
    """Run a motor: rms_mps2 an axis within band_hz, and `dps` of rates; `flat_too`: it runs from the start."""
    n, runs = len(course.omega), 1.0 if flat_too else course.after_flat[:, None]
    a, w = band_noise(n, course.step_s, band_hz, rng), band_noise(n, course.step_s, band_hz, rng)
    return rms_mps2 * runs * a, np.radians(dps) * runs * w


def coning(course: Course, rng: Rng, hz: float = 5.0, dps: float = 30.0) -> Push:
    """Turn the board's axis round a cone after the flat segment: rates of `dps` about an axis that turns at hz."""
    axis = direction(rng)
    e = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    e /= np.linalg.norm(e)
    phase = 2 * np.pi * hz * course.t[:, None]
    turning = np.cos(phase) * e + np.sin(phase) * np.cross(axis, e)
    return 0.0, np.radians(dps) * course.after_flat[:, None] * turning


def elevator(course: Course, rng: Rng, a_mps2: float = 1.0) -> Push:
    """Ride up and down, a_mps2 for two seconds at either end of each; the first begins after the flat segment."""
    a, t, up = np.zeros((len(course.omega), 3)), course.t, rng.choice([-1.0, 1.0])
    start = FLAT_S + rng.uniform(1.0, 5.0)
    while start < t[-1]:
        cruise = rng.uniform(3.0, 8.0)
        for at, sign in ((start, up), (start + 2.0 + cruise, -up)):
            share = np.clip((t - at) / 2.0, 0.0, 1.0)
            a[:, 2] += sign * a_mps2 * np.sin(np.pi * share) ** 2
        start, up = start + 4.0 + cruise + rng.uniform(3.0, 6.0), -up
    return a, 0.0


def swing(course: Course, rng: Rng, length_m: float = 2.2, deg: float = 10.0) -> Push:
    """Sit in a swing while the board is turned: a pendulum of length_m and amplitude deg, from the flat segment's end.

    Small angles: the pendulum is harmonic; the acceleration of its end is exact for that angle.
    """
    pulsation = np.sqrt(STANDARD_GRAVITY_MPS2 / length_m)
    since, amplitude = np.maximum(course.t - FLAT_S, 0.0), np.radians(deg)
    # set going within some seconds
    grown = 1.0 - np.exp(-((since / 3.0) ** 2))
    angle = amplitude * grown * np.sin(pulsation * since)
    rate = np.gradient(angle, course.step_s)
    tangential, central = length_m * np.gradient(rate, course.step_s), length_m * rate**2
    along = tangential * np.cos(angle) - central * np.sin(angle)
    upward = tangential * np.sin(angle) + central * np.cos(angle)
    heading = rng.uniform(0, 2 * np.pi)
    return np.stack((along * np.cos(heading), along * np.sin(heading), upward), axis=1), 0.0


def carried(course: Course, rng: Rng, rms_mps2: float = 0.2, band_hz: Span = (0.1, 0.5)) -> Push:
    """Ride in a boat or train: slow accelerations of rms_mps2 an axis within band_hz, the flat segment included."""
    return rms_mps2 * band_noise(len(course.omega), course.step_s, band_hz, rng), 0.0


def thumps(course: Course, rng: Rng, peak_mps2: float = 30.0) -> Push:
    """Set the board down with a knock of about peak_mps2, a ring at 60 Hz, at the end of each move."""
    ends = np.flatnonzero((course.moving[:-1] > 0.0) & (course.moving[1:] == 0.0)) + 1
    ring = np.arange(0.0, 0.1, course.step_s)
    shape = np.exp(-ring / 0.015) * np.sin(2 * np.pi * 60.0 * ring)
    a = np.zeros((len(course.omega), 3))
    for start in ends.tolist():
        room = min(len(shape), len(a) - start)
        a[start : start + room] += peak_mps2 * rng.uniform(0.5, 1.0) * shape[:room, None] * direction(rng)
    return a, 0.0


def sinking(course: Course, rng: Rng, dps: float = 0.3) -> Push:
    """Lay the board on something soft: what is flat or held still leans over for some seconds, by `dps` at first."""
    begins = np.r_[0, np.flatnonzero((course.moving[:-1] > 0.0) & (course.moving[1:] == 0.0)) + 1]
    omega = np.zeros((len(course.omega), 3))
    for first, last in zip(begins.tolist(), [*begins[1:].tolist(), len(omega)], strict=True):
        since = course.step_s * np.arange(last - first)
        omega[first:last] += np.radians(dps) * np.exp(-since / 4.0)[:, None] * direction(rng)
    return 0.0, omega * (course.moving == 0.0)[:, None]
