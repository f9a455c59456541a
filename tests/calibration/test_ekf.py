import numpy as np
import pytest

from mpucal.calibration.ekf import Ekf, exponential, gravity_jacobian, inverse, orientation_of, product, specific_force
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


def central(function, x, h=1e-6):
    return np.stack([(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=-1)


def test_measurement_jacobian_is_the_derivative_of_the_specific_force():
    np.testing.assert_allclose(G * gravity_jacobian(X), central(lambda x: specific_force(x, G), X), atol=1e-7)


def test_a_quaternion_step_turns_gravity_as_a_rotation_matrix_does():
    phi = np.array([0.4, -0.3, 1.2])
    turned = product(exponential(phi / 2)) @ X
    np.testing.assert_allclose(specific_force(turned, G), rotation(-phi) @ specific_force(X, G), atol=1e-12)


def test_prediction_covariance_is_that_of_finite_differences():
    filter_, _ = ekf()
    A = RNG.normal(size=(4, 4))
    x, P = filter_.predict(X[None], (A @ A.T)[None], 0)
    N = central(lambda x: filter_.F[0] @ x / np.linalg.norm(x), X)
    delta, omega, sd = 0.01, np.array([0.7, -1.1, 0.4]), np.sqrt([1e-3, 2e-3, 3e-3])
    M = central(lambda v: product(exponential(0.5 * delta * (omega - v))) @ X, np.zeros(3))
    np.testing.assert_allclose(x[0], filter_.F[0] @ X, atol=1e-14)
    np.testing.assert_allclose(P[0], N @ A @ A.T @ N.T + M @ np.diag(sd**2) @ M.T, atol=1e-7)


def test_process_noise_alone():
    filter_, _ = ekf()
    _, P = filter_.predict(X[None], np.zeros((1, 4, 4)), 0)
    delta, omega = 0.01, np.array([0.7, -1.1, 0.4])
    M = central(lambda v: product(exponential(0.5 * delta * (omega - v))) @ X, np.zeros(3))
    # The filter lets v_t turn x_{t+1} itself, which differs by half of the step's angle, 0.7 %.
    np.testing.assert_allclose(P[0], M @ np.diag([1e-3, 2e-3, 3e-3]) @ M.T, atol=1e-2 * np.abs(P).max())


def test_correction_is_the_textbook_one():
    filter_, _ = ekf()
    A = 0.1 * RNG.normal(size=(4, 4))
    P, y = A @ A.T, np.array([1.0, -4.0, 8.0])
    H = central(lambda x: D @ specific_force(x, G), X)
    S = H @ P @ H.T + filter_.Sigma_a
    gain = P @ H.T @ np.linalg.inv(S)
    e = y - D @ specific_force(X, G) - B_A
    x_new, P_new, e_new, S_new = filter_.correct(X[None], P[None], (y - B_A)[None], G * D[None])
    np.testing.assert_allclose(e_new[0], e, atol=1e-12)
    np.testing.assert_allclose(S_new[0], S, atol=1e-7)
    np.testing.assert_allclose(x_new[0], (X + gain @ e) / np.linalg.norm(X + gain @ e), atol=1e-7)
    np.testing.assert_allclose(P_new[0], (np.eye(4) - gain @ H) @ P, atol=1e-7)


def test_a_batched_pass_equals_one_at_a_time():
    filter_, _ = ekf(noise=0.1)
    sets = D + 0.05 * RNG.normal(size=(5, 3, 3)), B_A + 0.1 * RNG.normal(size=(5, 3))
    (together,) = filter_.run(*sets)
    for k in range(5):
        (alone,) = filter_.run(sets[0][k : k + 1], sets[1][k : k + 1])
        for name in ("e", "S", "x"):
            np.testing.assert_allclose(
                getattr(together, name)[:, k], getattr(alone, name)[:, 0], rtol=1e-10, atol=1e-12
            )


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


def test_inverse_and_determinant_are_lapacks():
    A = RNG.normal(size=(7, 2, 3, 3))
    S = A @ np.swapaxes(A, -1, -2) + 0.1 * np.eye(3)
    W, determinant = inverse(S)
    np.testing.assert_allclose(W, np.linalg.inv(S), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(determinant, np.linalg.det(S), rtol=1e-10)


@pytest.mark.parametrize("y", [(0, 0, 9.8), (0, 0, -9.8), (9.0, 0, 0), (0, -3.0, 0), (1, 2, 3), (1e-5, 0, -9)], ids=str)
def test_the_first_orientation_lies_along_the_mean(y):
    y = np.array(y, float)
    np.testing.assert_allclose(specific_force(orientation_of(y), 1.0), y / np.linalg.norm(y), atol=1e-5)
