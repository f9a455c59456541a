"""The families: what their world does is physics, and no verdict on a small set of them is false."""

from __future__ import annotations

import argparse
import json
from functools import partial

import numpy as np
import pytest
import scipy
from scipy.spatial.transform import Rotation

from mpucal.data import STANDARD_GRAVITY_MPS2
from tools.lab import families, runner
from tools.lab.judge import Judgement
from tools.lab.scenarios import around, body, course, family, faults, sensors, table

STEP_S = 1.0 / 2000.0


def turned_all_the_time(seconds=3.0):
    return course.continuous(STEP_S, np.random.default_rng(1), seconds)


def readings(**changes):
    """A family of one sensor that nothing is wrong with but what changes say, before counts."""
    return family.simulate(family.Family("of a test", hand=table.STEADY, chip=table.QUIET, **changes), 3)


def test_attitude_is_what_scipy_makes_of_the_rates():
    omega = turned_all_the_time(0.25).omega
    expected = Rotation.identity()
    for turn in Rotation.from_rotvec(omega * STEP_S):
        expected = expected * turn
    q = body.attitudes(omega, STEP_S, np.array([1.0, 0.0, 0.0, 0.0]))
    assert len(q) == len(omega) + 1
    assert (expected.inv() * Rotation.from_quat(q[-1, [1, 2, 3, 0]])).magnitude() < 1e-9


def test_finer_steps_do_not_change_the_attitude():
    t = np.arange(0.5, 20000) * STEP_S

    def end(times, step_s):
        omega = np.stack((np.sin(3 * times), np.cos(5 * times), 0.3 + 0 * times), axis=1)
        return body.attitudes(omega, step_s, np.array([1.0, 0.0, 0.0, 0.0]))[-1]

    finer = (np.arange(0.5, 80000)) * STEP_S / 4
    assert np.allclose(end(t, STEP_S), end(finer, STEP_S / 4), atol=2e-6)


def test_a_board_at_rest_feels_gravity_and_nothing_else():
    simulated = readings()
    truth, recording = simulated.truth, simulated.recording
    still = recording.t < course.FLAT_S - 0.1
    a = np.linalg.solve(truth.D, (recording.acc[still] - truth.b_a).T).T
    assert np.linalg.norm(a, axis=1).mean() == pytest.approx(truth.gravity, abs=2e-5)
    assert recording.gyr[still].mean(axis=0) == pytest.approx(truth.b_omega, abs=1e-5)


def test_a_point_on_a_lever_feels_what_the_formulas_of_rotation_say():
    n, rate, r = 4000, 2.0, np.array([0.3, 0.0, 0.0])
    omega = np.tile([0.0, 0.0, rate], (n, 1))
    q = body.attitudes(omega, STEP_S, np.array([1.0, 0.0, 0.0, 0.0]))
    force = body.specific_force(q, omega, STEP_S, 9.81, np.tile(r, (n, 1)), np.zeros((n, 3)))
    assert force == pytest.approx(np.tile([-(rate**2) * 0.3, 0.0, 9.81], (n, 1)), abs=1e-9)


def test_the_worlds_acceleration_is_felt_in_the_boards_axes():
    course = turned_all_the_time()
    n = len(course.omega)
    q = body.attitudes(course.omega, STEP_S, np.array([1.0, 0.0, 0.0, 0.0]))
    world = np.tile([1.0, -2.0, 0.5], (n, 1))
    force = body.specific_force(q, course.omega, STEP_S, 9.81, np.zeros((n, 3)), world)
    middle = Rotation.from_quat(q[:-1, [1, 2, 3, 0]]) * Rotation.from_rotvec(course.omega * STEP_S / 2)
    assert force == pytest.approx(middle.inv().apply(world + np.array([0.0, 0.0, 9.81])), abs=1e-4)


def test_who_sits_in_a_swing_feels_gravity_along_the_rope_at_its_ends():
    turned = turned_all_the_time(40.0)
    a, _ = around.swing(turned, np.random.default_rng(2), length_m=2.0, deg=5.0)
    settled = turned.t > 30.0
    # across the vertical, a pendulum of small angle accelerates by g times that angle at its ends
    ends = np.linalg.norm(a[settled, :2], axis=1).max()
    assert ends == pytest.approx(STANDARD_GRAVITY_MPS2 * np.radians(5.0), rel=0.02)


def test_noise_has_the_density_that_was_asked_for():
    rng = np.random.default_rng(0)
    y = np.zeros((400_000, 3))
    for one in (sensors.Sampling(), sensors.Sampling(lowpass_hz=40.0)):
        frequency, psd = scipy.signal.welch(one.gyroscope(y, 0.02, rng), 200.0, nperseg=1024, axis=0)
        passed = (frequency > 1.0) & (frequency < 15.0)
        assert np.sqrt(psd[passed].mean()) == pytest.approx(0.02, rel=0.05)


def test_flicker_is_as_strong_as_the_white_noise_at_its_corner():
    truth = sensors.Chip().draw(np.random.default_rng(0), 9.81)
    n = 100_000
    quiet = faults.Readings(
        np.arange(n) / 200.0, np.zeros(n), *(np.zeros((n, 3)) for _ in range(3)), np.zeros(n), truth, (39.2, 8.7)
    )
    noisy = faults.flicker(quiet, np.random.default_rng(1), accel_hz=3.0)
    frequency, psd = scipy.signal.welch(noisy.acc, 200.0, nperseg=4096, axis=0)
    for hz, ratio in ((3.0, 1.0), (30.0, 0.1)):
        near = (frequency > 0.8 * hz) & (frequency < 1.25 * hz)
        assert psd[near].mean() == pytest.approx(ratio * truth.accel_noise_density**2, rel=0.15)


def test_an_accelerometer_that_is_late_is_so_by_that_much():
    t = np.arange(0.5, 40_000) * STEP_S
    y = np.tile(np.sin(2 * np.pi * t)[:, None], (1, 3))
    rng = np.random.default_rng(0)
    late = sensors.Sampling(delay_ms=10.0).accelerometer(y, 0.0, rng)
    now = sensors.Sampling().gyroscope(y, 0.0, rng)
    assert late[2:] == pytest.approx(now[:-2], abs=1e-12)


def test_a_clock_that_is_fast_takes_more_samples_of_the_same_turn():
    fast = readings(sampling=sensors.Sampling(clock_error=0.02)).recording
    right = readings().recording
    assert len(fast) == pytest.approx(1.02 * len(right), rel=1e-3)
    assert fast.rate_hz == pytest.approx(200.0)


def test_a_step_of_the_zero_is_told_in_the_truth_as_its_mean():
    stepped = readings(faults=(partial(faults.zero_step, mg=30.0),))
    before = readings()
    moved = stepped.recording.acc - before.recording.acc
    after = before.recording.t >= course.FLAT_S
    assert np.linalg.norm(moved[-1]) == pytest.approx(0.03 * STANDARD_GRAVITY_MPS2)
    assert stepped.truth.b_a - before.truth.b_a == pytest.approx(moved[after].mean(axis=0))


def test_words_are_garbled_as_said():
    rng = np.random.default_rng(0)
    counts = rng.integers(-20_000, 20_000, (5000, 6)).astype(np.int32)
    dead = faults.low_byte_zero(counts.copy(), rng)
    changed = (dead != counts).any(axis=0)
    assert changed.sum() == 1 and (dead[:, changed] & 0xFF == 0).all()
    flipped = faults.flipped(counts.copy(), rng, per_byte=0.01) ^ counts
    bits = np.array([bin(x & 0xFFFF).count("1") for x in flipped.ravel()])
    assert bits.max() <= 2 and np.mean(bits) == pytest.approx(0.02, rel=0.2)
    signed = faults.signed_low(counts.copy(), rng)
    assert (signed == (counts >> 8) * 256 + counts.astype(np.uint8).view(np.int8)).all()


@pytest.mark.parametrize("name", ["jitter", "ticks", "bursts", "dropped", "each_twice", "polled"])
def test_times_increase_and_stay_beside_their_samples(name):
    t = np.arange(4000) / 200.0
    times, rows = getattr(faults, name)(t, np.random.default_rng(0))
    assert len(times) == len(rows)
    assert (np.diff(times) > 0).all() and (np.diff(rows) >= 0).all()
    assert np.abs(times - t[rows]).max() < 0.05


def test_every_family_gives_a_recording():
    """Simulates every twelfth of the table, but for those that take long."""
    families = [f for f in table.FAMILIES.values() if "20 minutes" not in f.name and "2 kHz" not in f.name]
    assert len({f.name for f in families}) > 70
    for one in families[::12]:
        simulated = family.simulate(one, 0)
        assert len(simulated.recording) > 1000, one.name
        assert np.allclose(simulated.truth.K, simulated.truth.K.T), one.name


def test_seeds_and_families_differ():
    simulate, families = family.simulate, table.FAMILIES
    first, again, other = (simulate(families["poses"], seed) for seed in (1, 1, 2))
    assert (first.recording.acc == again.recording.acc).all()
    assert not np.allclose(first.truth.D, other.truth.D)
    assert not np.allclose(first.truth.D, simulate(families["bench"], 1).truth.D)


def verdict(*, family="poses", **values):
    known = {"verdict": "good", "error": 0.01, "claim": 0.01, **values}
    return families.row(Judgement(known["verdict"], error=known["error"], claim=known["claim"]), family=family)


def test_what_is_called_false():
    assert not verdict().false
    assert verdict(error=0.031).false
    assert verdict(error=0.11, claim=0.1).false
    assert verdict(claim=float("nan")).false
    assert not verdict(verdict="usable", error=0.049).false
    assert verdict(verdict="usable", error=0.051).false
    assert not verdict(verdict="refused", error=9.0).false


def test_limits_that_are_broken_are_told_by_name():
    right = [verdict(), verdict(family="quiet poses", error=1e-4, claim=1e-4)]
    assert families.broken(right) == []
    wrong = [
        verdict(error=0.2),
        verdict(verdict="usable", error=0.1),
        verdict(family="quiet poses", error=5e-3),
    ]
    told = " ".join(families.broken(wrong))
    for words in ("1 of 2 good", "off by 0.2", "1 of 1 usable", "poses: 1 of 2", "quiet poses: median error 0.005"):
        assert words in told


def test_a_gravity_that_is_named_unlikely_is_the_unit_of_the_gains():
    run = families.of_seed(("gravity told 9.2", 100))
    assert run.verdict == "usable" and "gravity_unlikely" in run.reasons
    assert run.error < 0.02


def test_claims_that_are_too_wide_or_too_narrow_are_told():
    runs = [
        *(verdict(), verdict(family="bench", error=0.02), verdict(family="spins", error=0.004)),
        verdict(family="one axis", verdict="refused"),
    ]
    assert families.beside(runs) == pytest.approx({"bench": 2.0, "spins": 0.4})


# families that a release is not to judge falsely, and that take no more than some seconds together
SMALL = (
    *("poses", "poses of a session", "poses filtered", "continuous", "phone poses", "bench"),
    *("continuous 3 ms late", "clock 2 % fast", "six poses", "one axis", "words torn", "hysteresis poses"),
)


def test_no_verdict_of_a_small_set_is_false():
    runs = [families.of_seed((name, 100)) for name in SMALL]
    assert not [run for run in runs if run.false or run.verdict == "crashed"]
    assert families.broken(runs) == []


def test_the_tool_says_and_writes_what_it_found(tmp_path, capsys):
    path = tmp_path / "found.json"
    assert families.main(["--families", "one axis", "--seeds", "0:1", "--jobs", "1", "--json", str(path)]) == 0
    assert "one axis" in capsys.readouterr().out
    (run,) = json.loads(path.read_text())
    assert run["family"] == "one axis" and run["verdict"] in ("usable", "refused")


def test_a_family_that_does_not_exist_is_said_so():
    with pytest.raises(argparse.ArgumentTypeError, match="nothing is called 'nonsense'"):
        runner.names_of(table.FAMILIES)("nonsense")
