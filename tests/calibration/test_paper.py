"""Algorithm 1 of the paper and its EKF, compared with equation 8, with the truth, and on nonsense."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.calibration.paper import MAX_ITERATIONS, expand, fit_paper
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.rests.flat import Flat, flat_statistics
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82


def fitted(recording):
    return fit_paper(recording, flat_statistics(recording, recording.flat), G)


def test_a_simulated_sensor_is_found_with_right_standard_deviations():
    simulated = paper_scenario(0, rate_hz=10)
    fit, truth = fitted(simulated.recording), simulated.truth
    assert fit.converged
    assert 1 <= fit.iterations <= MAX_ITERATIONS
    assert 2.4 < fit.nis < 3.6
    error = np.concatenate([(fit.D - truth.D).ravel(), fit.b_a - truth.b_a])
    # It is a little above 1, as b_omega is fixed at the value of the flat segment.
    assert 0.5 < np.sqrt(np.mean(np.square(error / fit.std(*D_NAMES, *B_A_NAMES)))) < 1.9


def test_cost_is_equation_8_at_any_block_size(monkeypatch):
    simulated = paper_scenario(5, rate_hz=10)
    recording, truth = simulated.recording, simulated.truth
    ekf = Ekf.after(flat_statistics(recording, recording.flat), recording, G)
    (block,) = ekf.run(truth.D[None], truth.b_a[None])
    V = 0.0
    for e, S in zip(block.e[:, 0], block.S[:, 0], strict=True):
        V += 0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1])
    monkeypatch.setattr("mpucal.calibration.ekf.BLOCK", 64)
    np.testing.assert_allclose(expand(ekf, np.append(truth.D, truth.b_a)).V, V, rtol=1e-12)


@pytest.mark.parametrize("jitter", [0.0, 0.008], ids=["even", "jittered"])
def test_true_parameters_leave_no_innovation_at_any_time_steps(jitter):
    rng = np.random.default_rng(0)
    D, b_a = np.eye(3) + 0.2 * rng.normal(size=(3, 3)), np.array([0.3, -0.2, 0.5])
    t = np.cumsum(0.01 + jitter * rng.uniform(-0.5, 0.5, 300))
    omega, s_0 = np.array([0.7, -1.1, 0.4]), np.array([0.0, 0.0, G])
    s = np.array([rotation(-(time - t[0]) * omega) @ s_0 for time in t])
    recording = Recording.from_arrays(t, s @ D.T + b_a, np.tile(omega + 0.1, (300, 1)))
    flat = Flat(0, 0, s_0, np.full(3, 0.1), np.array([0.01, 0.02, 0.03]), np.array([1e-3, 2e-3, 3e-3]))
    (block,) = Ekf.after(flat, recording, G).run(D[None], b_a[None])
    np.testing.assert_allclose(block.e, 0.0, atol=1e-9)
    np.testing.assert_allclose(specific_force(block.x[:, 0], G), s, atol=1e-9)


def test_data_that_cannot_be_fitted_end_unconverged():
    recording = paper_scenario(8, rate_hz=10).recording
    noise = np.random.default_rng(0).standard_normal(recording.acc.shape)
    noise[: recording.flat[1]] = 0.0
    assert not fitted(replace(recording, acc=recording.acc + 1e150 * noise)).converged


def test_a_board_that_never_turns_is_fitted_without_a_claim():
    recording = paper_scenario(9, rate_hz=10).recording.part(0, 100)
    acc, gyr = (np.tile(values, (2, 1)) for values in (recording.acc, recording.gyr))
    fit = fitted(replace(recording, t=0.1 * np.arange(200), acc=acc, gyr=gyr, flat=(0, 100)))
    assert np.isfinite(fit.D).all()
    assert not (fit.std("D_xx") < 0.1)
