"""The families: their world obeys physics, and no verdict on a small set of them is false."""

from itertools import accumulate
from operator import mul

import numpy as np
import pytest
import scipy
from scipy.spatial.transform import Rotation

from tools.lab import families
from tools.lab.judge import judgement
from tools.lab.scenarios import body, course, faults, sensors

STEP_S = 1.0 / 2000.0


def test_the_worlds_acceleration_is_felt_in_the_boards_axes():
    omega = course.continuous(STEP_S, np.random.default_rng(1), 3.0).omega[-500:]
    q = body.attitudes(omega, STEP_S, np.array([1.0, 0.0, 0.0, 0.0]))
    turns = Rotation.from_rotvec(omega * STEP_S)
    scipys = list(accumulate(turns, mul, initial=Rotation.identity()))
    assert (scipys[-1].inv() * Rotation.from_quat(q[-1, [1, 2, 3, 0]])).magnitude() < 1e-9
    world = np.tile([1.0, -2.0, 0.5], (500, 1))
    force = body.specific_force(q, 9.81, world)
    middle = Rotation.concatenate(scipys[:-1]) * Rotation.from_rotvec(omega * STEP_S / 2)
    assert force == pytest.approx(middle.inv().apply(world + np.array([0.0, 0.0, 9.81])), abs=1e-4)


def test_noise_has_the_density_that_was_asked_for():
    rng = np.random.default_rng(0)
    y = np.zeros((100_000, 3))
    for one in (sensors.Sampling(), sensors.Sampling(lowpass_hz=40.0)):
        frequency, psd = scipy.signal.welch(one.gyroscope(y, 0.02, rng), 200.0, nperseg=1024, axis=0)
        passed = (frequency > 1.0) & (frequency < 15.0)
        assert np.sqrt(psd[passed].mean()) == pytest.approx(0.02, rel=0.05)


def test_words_are_garbled_as_documented():
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


def verdict(*, family="poses", **values):
    return families.row(judgement(**{"verdict": "good", "error": 0.01, "claim": 0.01, "family": family, **values}))


def test_broken_limits_are_reported_by_name():
    right = [verdict(), verdict(family="quiet poses", error=1e-4, claim=1e-4)]
    assert families.broken(right) == []
    assert verdict(error=0.031).false and verdict(claim=float("nan")).false
    assert not verdict(verdict="usable", error=0.049).false
    wrong = [
        verdict(error=0.2),
        verdict(verdict="usable", error=0.1),
        verdict(family="quiet poses", error=5e-3),
    ]
    told = " ".join(families.broken(wrong))
    for words in ("1 of 2 good", "off by 0.2", "1 of 1 usable", "poses: 1 of 2", "quiet poses: median error 0.005"):
        assert words in told


def test_pairs_with_true_uncertainties_are_told_apart_as_often_as_diff_promises():
    rng = np.random.default_rng(0)
    runs = [verdict(z=tuple(rng.standard_normal(12)), model="accel") for _ in range(200)]
    assert families.told_apart(runs) == pytest.approx(0.01, abs=0.003)
    for run in runs:
        run.model = "hand"
    assert families.told_apart(runs) < 0.001
    assert np.isnan(families.told_apart(runs[:1]))


def test_a_gravity_that_is_named_unlikely_is_the_unit_of_the_gains():
    run = families.of_seed(("gravity told 9.2", 100))
    assert run.verdict == "usable" and "gravity_unlikely" in run.reasons
    assert run.error < 0.02


# families that a release is not to judge falsely, of each kind one
SMALL = ("poses of a session", "continuous 3 ms late", "one axis", "words torn", "hysteresis poses")


def test_no_verdict_of_a_small_set_is_false():
    runs = [families.of_seed((name, 100)) for name in SMALL]
    assert not [run for run in runs if run.false or run.verdict == "crashed"]
    assert families.broken(runs) == []
