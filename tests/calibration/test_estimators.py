"""Estimators without a hand and their parts, compared with the truth, with the EKF, and with each other."""

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.calibration import calibrate, likelihood, parameters
from mpucal.calibration.ekf import Ekf, exponential, orientation_of, product
from mpucal.calibration.hypotheses import rank
from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.levenberg_marquardt import MOST_ITERATIONS, _nearer, minimise
from mpucal.calibration.model_selection import METHODS, choose_model
from mpucal.calibration.paper import expand
from mpucal.calibration.parameters import ACCEL, B_A_NAMES, D_NAMES, K_NAMES
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.sensitivity import find_sensitivity
from mpucal.calibration.theta import Prior
from mpucal.data import Recording
from mpucal.kernel import _kernel
from mpucal.rests.flat import flat_statistics
from tools.lab.judge import judged, sph_rms
from tools.lab.scenarios.body import attitudes, specific_force
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82
THETA_A = (*D_NAMES, *B_A_NAMES)


def by(method, recording):
    return method(recording, flat_statistics(recording, recording.flat), G)


def theta_a(fit):
    return np.concatenate([fit.D.ravel(), fit.b_a])


def problem_of(recording):
    flat = flat_statistics(recording, recording.flat)
    return Problem(Series.after(recording, flat), flat, G)


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


def test_the_3_state_filter_equals_the_quaternion_ekf():
    """Compare D and b_a by both filters from the same samples: within a tenth of a standard deviation.

    From the 3-state filter's optimum over all parameters, a Gauss-Newton step of the EKF leads to the EKF's own optimum
    over D and b_a, and this step is compared (a second one is a hundred times smaller).
    """
    problem = problem_of(paper_scenario(2).recording)
    flat = problem.flat
    known = Prior.of(b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)))
    minimum = minimise(problem, initialise(problem, flat.b_omega), ACCEL, known, until=1e-8)
    theta = minimum.theta
    ekf = ekf_of(problem, theta)
    at = expand(ekf, theta_a(theta))
    given_the_rest = np.sqrt(np.diag(np.linalg.inv(at.H)))
    assert np.abs(at.direction() / given_the_rest).max() < 0.1
    assert at.nis * len(ekf.y) == pytest.approx(minimum.nis * len(problem.series), rel=1e-3)


@pytest.fixture(scope="module")
def paper_runs():
    """Return thirty sensors of the paper's section 4.3, and their fits by `accel` and `imu`."""
    runs = [paper_scenario(seed, rate_hz=50) for seed in range(30)]
    return runs, {model: [by(METHODS[model], run.recording) for run in runs] for model in ("accel", "imu")}


def test_accel_needs_few_iterations_and_its_standard_deviations_are_right(paper_runs):
    runs, fits = paper_runs[0], paper_runs[1]["accel"]
    assert all(fit.converged for fit in fits)
    assert np.mean([fit.iterations for fit in fits]) <= 3.2
    z = [(theta_a(fit) - theta_a(run.truth)) / fit.std(*THETA_A) for run, fit in zip(runs, fits, strict=True)]
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15
    # Thirty runs estimate each of the twelve within these limits.
    assert (np.abs(np.sqrt(np.mean(np.square(z), axis=0)) - 1.0) < 0.45).all()


def test_with_a_perfect_gyroscope_imu_agrees_with_accel_and_auto_keeps_it_perfect(paper_runs):
    runs, fits = paper_runs
    for fit, plain in zip(fits["imu"], fits["accel"], strict=True):
        assert fit.converged
        assert (np.abs(theta_a(fit) - theta_a(plain)) < 5.0 * fit.std(*THETA_A)).all()
        assert (fit.std(*THETA_A) > 0.95 * plain.std(*THETA_A)).all()
    for run in runs[:5]:
        chosen = by(choose_model, run.recording)
        assert chosen.model == "accel"
        assert "perfect gyroscope" in chosen.why
        np.testing.assert_array_equal(chosen.honest().K, np.eye(3))


def wrong_gyro(seed):
    """Return the inverse K and K of a gyroscope with errors up to 3 % of scale and 1 % across axes."""
    rng = np.random.default_rng(seed)
    off = np.triu(rng.uniform(-0.01, 0.01, (3, 3)), 1)
    K = np.eye(3) + np.diag(rng.choice([-0.03, 0.03], 3)) + off + off.T
    return np.linalg.inv(K), K


def test_auto_finds_a_gyroscope_that_is_off_with_right_standard_deviations(ideal):
    z, models = [], []
    for seed in range(8):
        G_gyro, K = wrong_gyro(seed)
        made = ideal(seed, G_gyro=G_gyro, rate_hz=100)
        chosen = by(choose_model, made.recording)
        models.append(chosen.model)
        assert "not perfect" in chosen.why or "a lever arm" in chosen.why
        error = np.append(theta_a(chosen.honest()) - theta_a(made.truth), (chosen.honest().K - K)[np.triu_indices(3)])
        z.append(error / chosen.honest().std(*THETA_A, *K_NAMES))
    # Chance shows a lever arm in one recording of a hundred.
    assert models.count("imu") >= 7
    assert set(models) <= {"imu", "hand"}
    assert np.abs(z).max() < 4.0
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.3


def test_noise_as_large_as_the_rates_makes_no_scale_factor_error():
    runs = [paper_scenario(seed, turn_s=50.0) for seed in range(12)]  # 7 deg/s, and noise of 2 to 6 deg/s
    fits = [by(METHODS["imu"], run.recording) for run in runs]
    perfect = np.eye(3)[np.triu_indices(3)]
    z = np.array([(fit.K[np.triu_indices(3)] - perfect) / fit.std(*K_NAMES) for fit in fits])
    assert np.abs(z).max() < 4.0
    assert (np.abs(z.mean(axis=0)) < 4.0 / np.sqrt(len(runs))).all()
    assert [by(choose_model, run.recording).model for run in runs[:4]] == ["accel"] * 4


@pytest.mark.parametrize("seed", [0, 3, 10, 11])
def test_noise_as_large_as_the_rates_makes_no_sensitivity_to_acceleration(seed):
    recording = paper_scenario(seed, turn_s=50.0).recording
    fit = by(METHODS["accel"], recording)
    flat = flat_statistics(recording, recording.flat)
    found = find_sensitivity(recording, flat, G, fit, rank(fit.parts, fit.D))
    assert found is None or not found.S.any()


# ---- a lever arm


def beside_the_pivot(run, r):
    """Return the recording of a sensor at r (3,) [m] from the point about which it turned."""
    recording = run.recording
    rate = _kernel.moving_mean((recording.gyr - run.truth.b_omega) @ run.truth.K.T, 5)
    alpha = np.gradient(rate, recording.t, axis=0)
    force = np.cross(alpha, r) + np.cross(rate, np.cross(rate, r))
    return replace(recording, acc=recording.acc + force @ run.truth.D.T)


def test_a_sensor_beside_its_pivot_is_in_a_hand_and_one_at_it_is_not(ideal):
    run = ideal(2, rate_hz=100, turn_s=3.0)
    recording = beside_the_pivot(run, [0.015, -0.01, 0.008])
    chosen, in_place = calibrate(recording, "auto", G), calibrate(recording, "imu", G)
    assert chosen.fit["model"] == "hand"
    assert "the data show a lever arm of 1" in chosen.fit["why"]
    error, without = (sph_rms(run.truth, c.D, c.b_a) for c in (chosen, in_place))
    assert error < 0.7 * without
    assert calibrate(beside_the_pivot(ideal(0), [3e-4, 0.0, -3e-4]), "auto", G).fit["model"] in ("accel", "imu")


# ---- the first estimate, the minimiser and the kernel's table


def test_many_gaps_do_not_lead_to_a_wrong_optimum(hand, pick):
    simulated, rng = hand(4, "pose12"), np.random.default_rng(4)
    t = simulated.recording.t - simulated.recording.t[0]
    kept, at = np.ones(len(t), bool), 10.5
    while at < t[-1] - 1.0:
        last = at + rng.uniform(0.1, 0.5)
        kept &= (t < at) | (t >= last)
        at = last + rng.uniform(0.5, 5.0)
    found = calibrate(replace(pick(simulated.recording, kept), flat=simulated.recording.flat))
    assert found.fit["converged"]
    np.testing.assert_array_less(np.abs(found.b_a - simulated.truth.b_a), 4.0 * found.b_a_std)


def test_a_valley_without_an_end_is_left_soon():
    recording = paper_scenario(0, rate_hz=10, turn_s=330.0).recording
    slow = problem_of(recording)
    prior = Prior.of_sensor(slow.flat, recording.sensor)
    minimum = minimise(slow, initialise(slow, slow.flat.b_omega), ACCEL, prior, most=1000)
    assert not minimum.converged
    assert minimum.iterations < MOST_ITERATIONS


@pytest.mark.parametrize(
    ("decrement", "risen", "taken"), [(1.0, 5.0, True), (2.0, 5.0, False), (2.0, 0.5, True), (3.0, 0.5, False)]
)
def test_frozen_gains_may_raise_the_cost_by_more_in_a_step_that_halves_the_decrement(decrement, risen, taken):
    before, after = SimpleNamespace(decrement=2.5, V=0.0), SimpleNamespace(decrement=decrement, V=risen)
    assert _nearer(after, before) == taken


def test_a_kernel_of_another_table_is_refused(monkeypatch):
    monkeypatch.setattr(parameters, "LAYOUT", "another")
    with pytest.raises(ImportError, match="build it again"):
        importlib.reload(likelihood)


SENSOR = np.array([[1.01, 0.002, -0.003], [0.001, 0.985, 0.002], [-0.002, 0.003, 1.02]]), np.array([0.3, -0.2, 0.1])


def gimbal(seconds, inner_rate, outer_rate):
    """Return t (n,), the accelerometer's and the gyroscope's readings (n, 3) of a gimbal that never rests, 1 kHz."""
    t = 1e-3 * np.arange(1000 * seconds)
    on = np.clip((t - 10.0) / 2.0, 0.0, 1.0)
    inner = 1e-3 * inner_rate * np.cumsum(on)
    axis = np.stack([np.full(len(t), 0.8), 0.6 * np.sin(inner), 0.6 * np.cos(inner)], axis=1)  # the outer one
    omega = on[:, None] * ([inner_rate, 0.0, 0.0] - outer_rate * axis)
    D, b_a = SENSOR
    return t, specific_force(attitudes(omega, 1e-3), G, np.zeros(3)) @ D.T + b_a, omega


def z_of_noisy(acc, gyr, models):
    """Calibrate readings at 200 Hz with three noises: all are good, by one of the models; return z (3, 12)."""
    z = []
    for seed in range(3):
        rng, n = np.random.default_rng(seed), len(acc)
        noise = rng.normal(0.0, 0.03, (n, 3)), rng.normal(0.015, 0.001, (n, 3))
        calibration = calibrate(Recording.from_arrays(5e-3 * np.arange(n), acc + noise[0], gyr + noise[1]), "auto", G)
        assert calibration.verdict == "good"
        assert calibration.fit["model"] in models
        z.append(judged(calibration, SENSOR).z)
    return np.array(z)


@pytest.mark.parametrize(("delay_ms", "model"), [(1, "accel"), (4, "accel"), (20, "hand")])
def test_a_delay_between_the_sensors_is_no_turn_of_the_mount(delay_ms, model):
    """Turn the board at constant rates: gravity lags by the delay times the rate, as if the mount were turned."""
    _, acc, gyr = gimbal(70, 0.7, 0.45)
    acc = acc[25::5]
    z = z_of_noisy(acc, gyr[25 - delay_ms :: 5][: len(acc)], (model,))
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.abs(z).max() < 4.0


@pytest.mark.parametrize("kernel", [np.exp(-np.arange(400) / 32.0), np.ones(100)], ids=["5 Hz", "mean of 0.1 s"])
@pytest.mark.parametrize("rates", [(0.7, 0.45), (1.5, 1.1)])
def test_a_filter_of_both_sensors_is_no_scale_factor(rates, kernel):
    """Filter both sensors, as a chip's filter of 5 Hz or a person's mean does: gravity that turns loses 0.1 to 1 %."""
    _, acc, gyr = gimbal(70, *rates)
    kernel = kernel / kernel.sum()
    acc, gyr = (np.stack([np.convolve(of, kernel, "valid")[::5] for of in x.T], axis=1) for x in (acc, gyr))
    z = z_of_noisy(acc, gyr, ("accel", "imu"))
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.abs(z).max() < 4.0


def test_a_quiet_sensor_on_the_arm_of_a_machine_is_raw():
    """Turn a sensor of a thirtieth of the noise 10 cm beside the pivot: nothing shakes it as a hand does."""
    _, acc, gyr = gimbal(70, 0.7, 0.45)
    r, alpha = np.array([0.06, -0.08, 0.02]), np.gradient(gyr, 1e-3, axis=0)
    acc = (acc + (np.cross(alpha, r) + np.cross(gyr, np.cross(gyr, r))) @ SENSOR[0].T)[::5]
    rng = np.random.default_rng(0)
    readings = acc + rng.normal(0.0, 1e-4, acc.shape), gyr[::5] + rng.normal(0.0, 1e-5, acc.shape)
    assert calibrate(Recording.from_arrays(5e-3 * np.arange(len(acc)), *readings), "auto", G).verdict == "good"


@pytest.mark.parametrize("rates", [(0.3, 0.2), (0.5, 0.35), (0.7, 0.5)])
def test_a_gyroscope_that_warms_on_a_machine_that_never_rests_is_no_turn_of_the_mount(rates):
    """Remove the drift, which a mount and K may have caused in part where the machine turns evenly."""
    t, acc, gyr = gimbal(90, *rates)
    warmth = 1.0 - np.exp(-t / 60.0)
    z = z_of_noisy(acc[::5], (gyr + np.radians(0.5) * warmth[:, None] * [0.6, -0.5, 0.6])[::5], ("imu", "hand"))
    assert np.abs(z).max() < 4.0
