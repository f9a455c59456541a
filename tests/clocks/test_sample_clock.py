"""Sample clock against a chip whose clock is known, with looks that jitter."""

import numpy as np
import pytest

from mpucal.clocks.sample_clock import SampleClock, make_increasing, poll_phase

POLL_S = 0.020


def looks(rng, rate_hz, seconds, start_s=1.0, late_s=0.001):
    """Times [ns] and counts of polls, each latched up to `late_s` after its time, and the time of sample 0.

    Each poll is due 20 ms after the last, off by its phase, and comes up to 1 ms late.
    """
    first_s = start_s + rng.uniform(0, 1 / rate_hz)
    phases = np.array([poll_phase(n) for n in range(int(seconds / POLL_S))])
    t_s = start_s + np.cumsum(POLL_S + phases / rate_hz + rng.uniform(0, 0.001, len(phases)))
    latched_s = t_s + rng.uniform(0, late_s, len(t_s))
    taken = np.maximum(0, np.floor((latched_s - first_s) * rate_hz).astype(int) + 1)
    return np.rint(t_s * 1e9).astype(int), taken, first_s


def clock_of(nominal_hz, t_ns, taken):
    clock = SampleClock(nominal_hz)
    clock.begin_segment()
    if len(t_ns):
        clock.add(t_ns, taken)
    return clock


@pytest.mark.parametrize(
    ("nominal_hz", "seconds", "rms_ppm"),
    [(1000, 10, 8), (200, 10, 30), (1000, 30, 2), (200, 30, 6)],
)
def test_the_rate_is_measured_to_parts_per_million(nominal_hz, seconds, rms_ppm):
    error_ppm = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        rate_hz = nominal_hz * (1 + rng.uniform(-0.01, 0.01))
        t_ns, taken, _ = looks(rng, rate_hz, seconds)
        error_ppm.append((clock_of(nominal_hz, t_ns, taken).rate_hz / rate_hz - 1) * 1e6)
    assert np.sqrt(np.mean(np.square(error_ppm))) < rms_ppm


def test_times_are_those_of_the_samples():
    t_ns, taken, first_s = looks(np.random.default_rng(5), 198.7, 30, late_s=0.0)
    clock = clock_of(200, t_ns, taken)
    index = np.arange(taken[-1])
    errors_s = clock.times_s(np.full_like(index, clock.segment), index) - (first_s + index / 198.7)
    assert np.abs(errors_s).max() < 0.03 / 198.7


def test_segments_share_one_rate_and_keep_their_own_offset():
    """Ten segments of two seconds give the rate as well as a single one; their offsets differ."""
    rng = np.random.default_rng(6)
    clock, firsts = SampleClock(200), []
    for run in range(10):
        t_ns, taken, first_s = looks(rng, 201.3, 2, start_s=3.0 * run, late_s=0.0)
        firsts.append(first_s)
        clock.begin_segment()
        clock.add(t_ns, taken)
    assert clock.rate_hz == pytest.approx(201.3, rel=200e-6)
    zeros = clock.times_s(np.arange(10), np.zeros(10, np.int64))
    assert np.allclose(zeros, firsts, atol=0.1 / 200)


def test_the_rate_is_nominal_at_first_and_soon_within_its_tolerance():
    t_ns, taken, _ = looks(np.random.default_rng(7), 202.0, 1)
    rates = [clock_of(200, t_ns[:n], taken[:n]).rate_hz for n in range(0, len(t_ns), 5)]
    assert rates[0] == pytest.approx(200)
    assert all(197 < rate < 204 for rate in rates)
    assert rates[-1] == pytest.approx(202, rel=2e-3)


def test_the_prior_loses_its_weight():
    """A clone is 5 % off, which no data sheet allows."""
    t_ns, taken, _ = looks(np.random.default_rng(8), 210.0, 30)
    assert clock_of(200, t_ns, taken).rate_hz == pytest.approx(210, rel=20e-6)


def test_times_in_the_wrong_order_are_moved_as_little_as_possible():
    t_s = np.array([1.0, 2.0, 1.5, 1.6, 3.0])
    assert make_increasing(t_s, 0.1).tolist() == pytest.approx([1.0, 2.0, 2.1, 2.2, 3.0])
    in_order = np.random.default_rng(9).uniform(0.11, 0.3, 1000).cumsum()
    assert make_increasing(in_order, 0.1) is in_order
