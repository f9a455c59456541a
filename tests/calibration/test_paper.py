from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.calibration.ekf import Ekf
from mpucal.calibration.paper import MAX_ITERATIONS, expand, fit_paper
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import paper_scenario

SHARED = Path(__file__).parents[2].parent / "shared" / "simulated"
G = 9.82


def fitted(recording):
    return fit_paper(recording, flat_statistics(recording, recording.flat), G)


def test_it_finds_simulated_sensors_with_right_standard_deviations():
    z = []
    for seed in (0, 1):
        simulated = paper_scenario(seed, rate_hz=20)
        fit, truth = fitted(simulated.recording), simulated.truth
        assert fit.converged
        assert 1 <= fit.iterations <= MAX_ITERATIONS
        assert 2.4 < fit.nis < 3.6
        assert sph_rms(truth, fit.D, fit.b_a) < 0.3
        error = np.concatenate([(fit.D - truth.D).ravel(), fit.b_a - truth.b_a])
        z.append(error / fit.std(*D_NAMES, *B_A_NAMES))
    # It is a little above 1, as b_omega is fixed at the value of the flat segment.
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.7


@pytest.mark.skipif(not SHARED.is_dir(), reason="the other simulator's recordings are not beside this checkout")
def test_it_finds_the_sensor_of_another_simulator():
    with np.load(SHARED / "paper_0.npz") as file:
        every = 4  # downsampled: a quarter of the time, twice the error
        n_flat = int(file["flat_samples"]) // every
        columns = (file[key][::every] for key in ("t", "acc", "gyr"))
        recording = Recording.from_arrays(*columns, flat=(0, n_flat))
        truth = SensorTruth(
            *(file[f"true_{key}"] for key in ("D", "b_a", "K", "b_omega")), gravity=float(file["gravity"])
        )
    fit = fitted(recording)
    assert fit.converged
    assert sph_rms(truth, fit.D, fit.b_a) < 0.4


def test_cost_is_equation_8():
    simulated = paper_scenario(5, rate_hz=10)
    recording, truth = simulated.recording, simulated.truth
    ekf = Ekf.after(flat_statistics(recording, recording.flat), recording, G)
    theta = np.concatenate([truth.D.ravel(), truth.b_a])
    (block,) = ekf.run(truth.D[None], truth.b_a[None])
    V = 0.0
    for e, S in zip(block.e[:, 0], block.S[:, 0], strict=True):
        V += 0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1])
    np.testing.assert_allclose(expand(ekf, theta).V, V, rtol=1e-12)


def test_hessian_is_near_the_curvature_of_the_cost():
    simulated = paper_scenario(5, rate_hz=10)
    recording = simulated.recording
    ekf = Ekf.after(flat_statistics(recording, recording.flat), recording, G)
    fit = fitted(recording)
    theta = np.concatenate([fit.D.ravel(), fit.b_a])
    H = np.linalg.inv(fit.covariance)
    step = 0.3 * np.sqrt(np.diag(fit.covariance))
    for k in (0, 1, 5, 9):
        e = step[k] * np.eye(12)[k]
        curvature = (expand(ekf, theta + e).gradient - expand(ekf, theta - e).gradient)[k] / (2 * step[k])
        assert curvature == pytest.approx(H[k, k], rel=0.25)


@pytest.mark.parametrize("scale", [1e3, 1e150], ids=["nonsense", "overflow"])
def test_data_that_cannot_be_fitted_end_unconverged(scale):
    recording = paper_scenario(8, rate_hz=10).recording
    noise = np.random.default_rng(0).standard_normal(recording.acc.shape)
    noise[: recording.flat[1]] = 0.0
    fit = fitted(replace(recording, acc=recording.acc + scale * noise))
    assert not fit.converged


def test_a_board_that_never_turns_is_fitted_without_a_claim():
    recording = paper_scenario(9, rate_hz=10).recording.part(0, 100)
    still = replace(
        recording,
        t=0.1 * np.arange(200),
        acc=np.tile(recording.acc, (2, 1)),
        gyr=np.tile(recording.gyr, (2, 1)),
        flat=(0, 100),
    )
    fit = fitted(still)
    assert np.isfinite(fit.D).all()
    assert not (fit.std("D_xx") < 0.1)
