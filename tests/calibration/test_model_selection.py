"""Estimators without a hand, compared with the truth, with the quaternion EKF, and with each other."""

import numpy as np
import pytest

from mpucal.calibration import model_selection
from mpucal.calibration.ekf import Ekf, exponential, orientation_of, product
from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.levenberg_marquardt import minimise
from mpucal.calibration.model_selection import METHODS, choose_model, fit_accel, fit_imu
from mpucal.calibration.paper import expand
from mpucal.calibration.parameters import ACCEL, B_A_NAMES, BY_NAME, D_NAMES, K_NAMES
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.theta import Prior
from mpucal.rests.flat import flat_statistics
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82
THETA_A = (*D_NAMES, *B_A_NAMES)
K_SD = np.array(BY_NAME["K"].sd)


def by(method, recording):
    return method(recording, flat_statistics(recording, recording.flat), G)


def theta_a(fit):
    return np.concatenate([fit.D.ravel(), fit.b_a])


def ekf_of(problem, theta):
    """Return the quaternion EKF over a problem of the 3-state filter, with the same samples, turns and start.

    The flat mean counts n times in the 3-state filter, so it is measured n times at rest here. The EKF does not
    estimate b_omega and the starting orientation, and takes them from that filter.
    """
    series, flat = problem.series, problem.flat
    n = flat.n
    delta = np.concatenate([np.zeros(n - 1), series.dt, [0.0]])[:, None]
    rates = np.concatenate([np.zeros((n - 1, 3)), series.omega - theta.b_omega, np.zeros((1, 3))])
    return Ekf(
        y=np.concatenate([np.tile(flat.y, (n, 1)), series.y]),
        F=product(exponential(0.5 * delta * rates)),
        sigma_phi=0.5 * delta * np.sqrt(flat.Sigma_omega),
        Sigma_a=np.diag(flat.Sigma_a),
        x_0=orientation_of(theta.u),
        P_0=np.zeros((4, 4)),
        gravity=problem.gravity,
    )


@pytest.mark.parametrize("number", [0, 2])
def test_the_3_state_filter_equals_the_quaternion_ekf(other_simulator, number):
    """Compare D and b_a by both filters from the same samples: within a tenth of a standard deviation.

    From the 3-state filter's optimum over all parameters, a Gauss-Newton step of the EKF leads to the EKF's own optimum
    over D and b_a, and this step is compared (a second one is a hundred times smaller).
    """
    other = other_simulator(f"paper_{number}")
    recording, flat = other.recording, flat_statistics(other.recording, other.recording.flat)
    problem = Problem(Series.after(recording, flat), flat, G)
    known = Prior.of(b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)))
    minimum = minimise(problem, initialise(problem, flat.b_omega), ACCEL, known, until=1e-8)
    theta = minimum.theta
    ekf = ekf_of(problem, theta)
    at = expand(ekf, np.concatenate([theta.D.ravel(), theta.b_a]))
    given_the_rest = np.sqrt(np.diag(np.linalg.inv(at.H)))
    assert np.abs(at.direction() / given_the_rest).max() < 0.1
    assert at.nis * len(ekf.y) == pytest.approx(minimum.nis * len(problem.series), rel=1e-3)


def test_accel_finds_the_other_simulators_sensors(other_simulator):
    errors = []
    for number in range(4):
        other = other_simulator(f"paper_{number}")
        fit = by(fit_accel, other.recording)
        assert fit.converged
        assert fit.iterations <= 4
        assert 2.8 < fit.nis < 3.2
        errors.append(sph_rms(other.truth, fit.D, fit.b_a))
    assert np.mean(errors) <= 0.1


@pytest.fixture(scope="module")
def paper_runs():
    """Return forty sensors of the paper's section 4.3, and their fits by `accel` and `imu`."""
    runs = [paper_scenario(seed, rate_hz=50) for seed in range(40)]
    return runs, {model: [by(METHODS[model], run.recording) for run in runs] for model in ("accel", "imu")}


def z_scores(runs, fits):
    off = [theta_a(fit) - theta_a(run.truth) for run, fit in zip(runs, fits, strict=True)]
    return np.array(off) / [fit.std(*THETA_A) for fit in fits]


def test_the_standard_deviations_of_accel_are_right(paper_runs):
    runs, fits = paper_runs
    z = z_scores(runs, fits["accel"])
    assert 0.85 < np.sqrt((z**2).mean()) < 1.15
    # Forty runs estimate each of the twelve within these limits.
    assert (np.sqrt((z**2).mean(0)) < 1.4).all()
    assert (np.sqrt((z**2).mean(0)) > 0.65).all()


def test_accel_never_fails_and_needs_few_iterations(paper_runs):
    runs, fits = paper_runs
    for run, fit in zip(runs, fits["accel"], strict=True):
        assert fit.converged
        assert sph_rms(run.truth, fit.D, fit.b_a) < 0.3
    assert np.mean([fit.iterations for fit in fits["accel"]]) <= 3.2


def test_the_gyroscopes_bias_is_estimated_beyond_the_flat_segment(paper_runs):
    runs, fits = paper_runs
    z, gained = [], []
    for run, fit in zip(runs, fits["accel"], strict=True):
        flat = flat_statistics(run.recording, run.recording.flat)
        sd = fit.std("b_omega_x", "b_omega_y", "b_omega_z")
        z.append((fit.b_omega - run.truth.b_omega) / sd)
        gained.append(sd / np.sqrt(flat.Sigma_omega / flat.n))
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert np.max(gained) <= 1.0 + 1e-9
    assert np.median(gained) < 0.9


def test_with_a_perfect_gyroscope_imu_agrees_with_accel_and_is_less_certain(paper_runs):
    _, fits = paper_runs
    for fit, plain in zip(fits["imu"], fits["accel"], strict=True):
        assert fit.converged
        assert (np.abs(theta_a(fit) - theta_a(plain)) < 5.0 * fit.std(*THETA_A)).all()
        assert (fit.std(*THETA_A) > 0.95 * plain.std(*THETA_A)).all()


def test_auto_keeps_a_perfect_gyroscope_perfect(paper_runs):
    runs, _ = paper_runs
    for run in runs[:10]:
        chosen = by(choose_model, run.recording)
        assert chosen.model == "accel"
        assert "perfect gyroscope" in chosen.why
        np.testing.assert_array_equal(chosen.fit.K, np.eye(3))


def wrong_gyro(seed):
    """Return the inverse K and K of a gyroscope with errors up to 3 % of scale and 1 % across axes."""
    rng = np.random.default_rng(seed)
    off = np.triu(rng.uniform(-0.01, 0.01, (3, 3)), 1)
    K = np.eye(3) + np.diag(rng.choice([-0.03, 0.03], 3)) + off + off.T
    return np.linalg.inv(K), K


def test_auto_finds_a_gyroscope_that_is_off(ideal):
    z = []
    for seed in range(10):
        G_gyro, K = wrong_gyro(seed)
        chosen = by(choose_model, ideal(seed, G_gyro=G_gyro, rate_hz=100).recording)
        assert chosen.model == "imu", seed
        assert "not perfect" in chosen.why
        sd = chosen.fit.std(*K_NAMES)
        assert (sd <= K_SD * 1.0001).all()
        z.append((chosen.fit.K - K)[np.triu_indices(3)] / sd)
    assert np.abs(z).max() < 3.5
    assert np.sqrt(np.mean(np.square(z))) < 1.3


def test_elements_of_k_that_one_turn_about_each_axis_leaves_open_keep_their_prior(ideal):
    G_gyro, _ = wrong_gyro(0)
    fit = by(fit_imu, ideal(0, G_gyro=G_gyro, rate_hz=100).recording)
    assert set(fit.at_prior) < set(K_NAMES)
    assert "K_zz" in fit.at_prior  # about the vertical: gravity does not turn
    assert not {"K_xx", "K_yy"} & set(fit.at_prior)
    for name, before in zip(K_NAMES, K_SD, strict=True):
        assert (fit.std(name)[0] > 0.5 * before) == (name in fit.at_prior)


def test_the_standard_deviations_of_imu_are_right_for_many_gyroscopes(ideal):
    z = []
    for seed in range(25):
        rng = np.random.default_rng(1000 + seed)
        six = K_SD * rng.standard_normal(6)
        K = np.eye(3)
        K[np.triu_indices(3)] += six
        K = np.triu(K) + np.triu(K, 1).T
        simulated = ideal(seed, G_gyro=np.linalg.inv(K))
        fit = by(fit_imu, simulated.recording)
        error = np.append(theta_a(fit) - theta_a(simulated.truth), (fit.K - K)[np.triu_indices(3)])
        z.append(error / fit.std(*THETA_A, *K_NAMES))
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.2


@pytest.mark.parametrize("gravity", [9.78, 9.832])
def test_gravity_scales_the_gains_alone(gravity):
    recording = paper_scenario(0, rate_hz=50).recording
    flat = flat_statistics(recording, recording.flat)
    here, there = fit_accel(recording, flat, G), fit_accel(recording, flat, gravity)
    np.testing.assert_allclose(there.D * gravity, here.D * G, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(there.b_a, here.b_a, atol=1e-2)


def test_a_long_recording_is_searched_by_coarser_means_to_the_same_end(monkeypatch):
    recording = paper_scenario(4, rate_hz=50, turn_s=20.0).recording
    at_once = by(fit_accel, recording)
    monkeypatch.setattr(model_selection, "MANY_MEANS", 100)
    by_coarser = by(fit_accel, recording)
    assert by_coarser.converged
    assert not np.array_equal(by_coarser.D, at_once.D)  # the search took another way
    np.testing.assert_array_less(np.abs(by_coarser.D - at_once.D).ravel(), 0.05 * at_once.std(*D_NAMES))
