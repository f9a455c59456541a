import numpy as np
import pytest

from mpucal.calibration.ekf import Ekf, orientation_of, specific_force
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.rests.flat import Flat

G = 9.82
RNG = np.random.default_rng(1)
X = RNG.normal(size=4)
X /= np.linalg.norm(X)
D = np.eye(3) + 0.2 * RNG.normal(size=(3, 3))
B_A = np.array([0.3, -0.2, 0.5])


def ekf(n=60, jitter=0.0, noise=0.0, seed=0):
    """Return a filter over a constant turn, and the true specific forces on the way."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(n) + jitter * rng.uniform(-0.5, 0.5, n)
    omega = np.array([0.7, -1.1, 0.4])
    s_0 = np.array([0.0, 0.0, G])
    s = np.array([rotation(-(time - t[0]) * omega) @ s_0 for time in t])
    acc = s @ D.T + B_A + noise * rng.normal(size=(n, 3))
    recording = Recording.from_arrays(t, acc, np.tile(omega + 0.1, (n, 1)))
    flat = Flat(0, 0, s_0, np.full(3, 0.1), np.array([0.01, 0.02, 0.03]), np.array([1e-3, 2e-3, 3e-3]))
    return Ekf.after(flat, recording, G), s


@pytest.mark.parametrize("jitter", [0.0, 0.008], ids=["even", "jittered"])
def test_true_parameters_leave_no_innovation_whatever_the_time_steps(jitter):
    filter_, s = ekf(n=300, jitter=jitter)
    (block,) = filter_.run(D[None], B_A[None])
    np.testing.assert_allclose(block.e, 0.0, atol=1e-9)
    np.testing.assert_allclose(specific_force(block.x[:, 0], G), s, atol=1e-9)


def test_blocks_go_on_where_the_last_one_ended(monkeypatch):
    filter_, _ = ekf(noise=0.1)
    (whole,) = filter_.run(D[None], B_A[None])
    monkeypatch.setattr("mpucal.calibration.ekf.BLOCK", 7)
    parts = list(filter_.run(D[None], B_A[None]))
    assert len(parts) == 9
    np.testing.assert_array_equal(np.concatenate([part.e for part in parts]), whole.e)


@pytest.mark.parametrize("y", [(0, 0, 9.8), (0, 0, -9.8), (9.0, 0, 0), (0, -3.0, 0), (1, 2, 3), (1e-5, 0, -9)], ids=str)
def test_the_first_orientation_lies_along_the_mean(y):
    y = np.array(y, float)
    np.testing.assert_allclose(specific_force(orientation_of(y), 1.0), y / np.linalg.norm(y), atol=1e-5)
