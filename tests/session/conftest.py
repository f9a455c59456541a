"""A board that is laid down, turned and shaken, as samples."""

import numpy as np
import pytest

from mpucal.data import Samples

RATE_HZ = 100.0
GRAVITY_MPS2 = 9.80665


def rotation(axis, angle_rad):
    """Rodrigues' formula, (3, 3)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross


class Board:
    """Time goes on from one call to the next; each returns what a sensor with these biases measures meanwhile."""

    def __init__(self, gyr_bias=(0.05, -0.1, 0.02), acc_noise=0.03, gyr_noise=0.003, seed=0):
        self.up = np.array([0.0, 0.0, 1.0])
        self.t_s = 0.0
        self._bias = np.array(gyr_bias)
        self._noise = acc_noise, gyr_noise
        self._rng = np.random.default_rng(seed)

    def still(self, seconds):
        return self._samples(np.tile(self.up, (self._count(seconds), 1)), np.zeros(3))

    def turn(self, axis, angle_rad, seconds):
        """About an axis of the board, at a constant rate."""
        n = self._count(seconds)
        angles = angle_rad * (np.arange(n) + 1) / n
        ups = np.array([rotation(axis, -angle) @ self.up for angle in angles])
        self.up = ups[-1]
        return self._samples(ups, np.asarray(axis, float) / np.linalg.norm(axis) * angle_rad / seconds)

    def turn_to(self, up, seconds=1.6):
        """The shortest way to where `up` points up."""
        up = np.asarray(up, float) / np.linalg.norm(up)
        axis = np.cross(self.up, up)
        if np.linalg.norm(axis) < 1e-9:
            axis = np.cross(self.up, [0.3, 0.5, 0.8])
        return self.turn(-axis, np.arccos(np.clip(self.up @ up, -1.0, 1.0)), seconds)

    def shaken(self, seconds, acc_mps2):
        samples = self.still(seconds)
        samples.acc[:, 0] += acc_mps2 * np.sqrt(2) * np.sin(2 * np.pi * 5.0 * samples.t)
        return samples

    def silence(self, seconds):
        """Samples are lost."""
        self.t_s += seconds

    def _count(self, seconds):
        return round(seconds * RATE_HZ)

    def _samples(self, ups, rate_rad_s):
        n = len(ups)
        acc_noise, gyr_noise = self._noise
        t = self.t_s + (np.arange(n) + 1) / RATE_HZ
        self.t_s = float(t[-1])
        no = np.zeros(n, bool)
        return Samples(
            t,
            GRAVITY_MPS2 * ups + acc_noise * self._rng.normal(size=(n, 3)),
            rate_rad_s + self._bias + gyr_noise * self._rng.normal(size=(n, 3)),
            np.full(n, 25.0),
            no,
            no.copy(),
            no.copy(),
        )


@pytest.fixture
def board():
    return Board()


@pytest.fixture(scope="session")
def make_board():
    return Board


# Varied orientations: faces, edges and corners, each 50 to 130 degrees from the one before.
VARIED = (
    (1, 0, 0),
    (0, 1, 1),
    (-1, 0, 0.3),
    (0, -1, -1),
    (1, 1, -1),
    (0, 0, -1),
    (-1, 1, -0.5),
    (0, 1, 0),
    (1, -1, 0.5),
    (-1, -1, 0),
    (1, 0, -1),
    (-1, 1, 1),
    (0.5, -1, 1),
)


@pytest.fixture(scope="session")
def varied():
    return VARIED
