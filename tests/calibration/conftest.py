"""Recordings of a nearly ideal sensor with a known truth, and files of others."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.data import Recording
from mpucal.simulated.sensor import SensorTruth, density
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82


def near_ideal(seed=0, D=None, G_gyro=None, **scenario):
    """Simulate the paper's turns of a sensor whose axes, gains and biases are nearly right by default."""
    scenario = {"rate_hz": 50, **scenario}
    sensor = SensorTruth(
        D=np.eye(3) if D is None else np.asarray(D, float),
        b_a=np.array([0.1, -0.2, 0.15]),
        K=np.eye(3) if G_gyro is None else np.linalg.inv(G_gyro),
        b_omega=np.array([0.02, -0.03, 0.01]),
        gravity=G,
        accel_noise_density=density(0.08, scenario["rate_hz"]),
        gyro_noise_density=density(0.03, scenario["rate_hz"]),
    )
    return paper_scenario(seed, sensor=sensor, **scenario)


def samples_of(recording, kept):
    """Return the recording with the samples `kept` (n,) bool, and without a known flat segment."""
    return replace(recording, flat=None, **vars(recording.at(kept)))


@pytest.fixture(scope="session")
def ideal():
    """Return a factory of near-ideal simulated recordings."""
    return near_ideal


@pytest.fixture(scope="session")
def pick():
    """Return a function that keeps some of a recording's samples."""
    return samples_of


@pytest.fixture(scope="session")
def others(shared):
    """Return a function that loads the arrays of a file of others, by its path without the suffix."""

    def load(name):
        with np.load(*shared(f"{name}.npz")) as file:
            return dict(file)

    return load


@pytest.fixture(scope="session")
def real(others):
    """Return a function that loads a real sensor's recording by its name, without a known flat segment."""

    def load(name):
        arrays = others(f"recordings/{name}")
        return Recording.from_arrays(arrays["t"], arrays["acc"], arrays["gyr"], name=name)

    return load
