"""The board as a rigid body: its shaking in a hand, its attitude from rates, and what a sensor on it feels."""

from __future__ import annotations

import numpy as np

from mpucal.data import Vector
from mpucal.simulated import rotation
from mpucal.simulated.disturbance import JERK_MPS2, JERK_S, SWAY_HZ, TREMOR_HZ, HandDisturbance, point_acceleration

from .course import direction

PIVOT_HZ = (0.05, 0.4)


def acceleration(
    habits: HandDisturbance, omega: Vector, moving: Vector, holding: Vector, step_s: float, rng: np.random.Generator
) -> Vector:
    """Return the board's acceleration (n, 3) [m/s^2] in the body, turned by omega (n, 3) [rad/s] at steps of step_s.

    moving, holding : (n,) how much the hand moves or holds a pose, 0 to 1.
    """
    n = len(omega)
    a = lever_acceleration(omega, _lever(habits, moving, step_s, rng), step_s)
    a += habits.sway_mps2 * moving[:, None] * band_noise(n, step_s, SWAY_HZ, rng)
    a += _jerks(habits, moving, step_s, rng)
    a += habits.tremor_mps2 * holding[:, None] * band_noise(n, step_s, TREMOR_HZ, rng)
    return a


def tremor(habits: HandDisturbance, holding: Vector, step_s: float, rng: np.random.Generator) -> Vector:
    """Return the rates (n, 3) [rad/s] of the tremor."""
    return habits.tremor_rad_s * holding[:, None] * band_noise(len(holding), step_s, TREMOR_HZ, rng)


def _lever(habits: HandDisturbance, moving: Vector, step_s: float, rng: np.random.Generator) -> Vector:
    """Return the sensor's place from the pivot (n, 3) [m], in the body."""
    along, length = direction(rng), rng.uniform(*habits.lever_m)
    # an rms of wobble * length over three axes
    rms = habits.wobble * length / np.sqrt(3.0)
    travel = rms * moving[:, None] * band_noise(len(moving), step_s, PIVOT_HZ, rng)
    return np.asarray(length * along + travel)


def _jerks(habits: HandDisturbance, moving: Vector, step_s: float, rng: np.random.Generator) -> Vector:
    """Return half sines that begin while the hand moves."""
    n = len(moving)
    a = np.zeros((n, 3))
    for start in np.flatnonzero(rng.random(n) < habits.jerks_per_s * step_s * moving).tolist():
        length = min(int(rng.uniform(*JERK_S) / step_s), n - start)
        peak = direction(rng) * rng.uniform(*JERK_MPS2)
        a[start : start + length] += np.sin(np.pi * (np.arange(length) + 0.5) / length)[:, None] * peak
    return a


def lever_acceleration(omega: Vector, r: Vector, step_s: float) -> Vector:
    """Return the acceleration (n, 3) [m/s^2] in the body of a point r (n, 3) [m] of it, itself moving or not."""
    alpha, v = np.gradient(omega, step_s, axis=0), np.gradient(r, step_s, axis=0)
    return np.asarray(point_acceleration(alpha, omega, r, v) + np.gradient(v, step_s, axis=0))


def band_noise(n: int, step_s: float, band_hz: tuple[float, float], rng: np.random.Generator) -> Vector:
    """Draw (n, 3) Gaussian noise between two frequencies, of rms 1 an axis."""
    frequency = np.fft.rfftfreq(n, step_s)
    band = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    spectrum = np.zeros((len(frequency), 3), complex)
    spectrum[band] = rng.standard_normal((band.sum(), 3)) + 1j * rng.standard_normal((band.sum(), 3))
    noise = np.fft.irfft(spectrum, n, axis=0)
    scaled: Vector = noise / np.sqrt((noise**2).mean(0))
    return scaled


# steps multiplied out one after the other in each of the blocks that go side by side
BLOCK = 256


def attitudes(omega: Vector, step_s: float, start: Vector) -> Vector:
    """Return quaternions (n + 1, 4) from `start` (4,) on, turned by omega (n, 3) [rad/s] for step_s each."""
    n = len(omega)
    blocks = -(-n // BLOCK)
    turns = np.zeros((blocks * BLOCK, 3))
    turns[:n] = step_s * omega
    q = rotation.exp(turns).reshape(blocks, BLOCK, 4).swapaxes(0, 1).copy()
    for k in range(1, BLOCK):
        q[k] = rotation.product(q[k - 1], q[k])
    first = rotation.running_product(start, q[-1])[:-1]
    return np.concatenate((start[None], rotation.product(first, q).swapaxes(0, 1).reshape(-1, 4)[:n]))


def in_board(q: Vector, world: Vector) -> Vector:
    """Return vectors (n, 3) of the world in axes of boards of attitude q (n, 4): v - 2 w (u x v) + 2 u x (u x v)."""
    w, u = q[:, :1], q[:, 1:]
    across = np.cross(u, world)
    return np.asarray(world - 2.0 * w * across + 2.0 * np.cross(u, across))


def specific_force(q: Vector, omega: Vector, step_s: float, gravity: float, lever_m: Vector, world: Vector) -> Vector:
    """Return what a sensor feels (n, 3) [m/s^2] in each step, in the axes of the board.

    Parameters
    ----------
    q : (n + 1, 4) the attitude at the ends of the steps. omega : (n, 3) rad/s.
    lever_m : (n, 3) the sensor's place from the pivot, in the body. world : (n, 3) m/s^2, the pivot's acceleration.
    """
    up = rotation.up_in_board(q)
    force = 0.5 * gravity * (up[:-1] + up[1:])
    if world.any():
        force += in_board(0.5 * (q[:-1] + q[1:]), world)
    if lever_m.any():
        force += lever_acceleration(omega, lever_m, step_s)
    return np.asarray(force)
