"""Sample clock against a chip whose clock is known, with looks that jitter."""

import numpy as np
import pytest

from mpucal.clocks.piecewise_rate import find_breaks
from mpucal.clocks.sample_clock import SampleClock, poll_phase

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
    [(1000, 10, 8), (200, 30, 6)],
)
def test_the_rate_is_measured_to_parts_per_million(nominal_hz, seconds, rms_ppm):
    error_ppm = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        rate_hz = nominal_hz * (1 + rng.uniform(-0.01, 0.01))
        t_ns, taken, _ = looks(rng, rate_hz, seconds)
        error_ppm.append((clock_of(nominal_hz, t_ns, taken).rate_hz / rate_hz - 1) * 1e6)
    assert np.sqrt(np.mean(np.square(error_ppm))) < rms_ppm


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


def counted(rates_hz, each_s=20.0, seed=0, late_s=0.001):
    """Times and counts of looks every 40 ms at a chip whose rate changes every `each_s`."""
    rng = np.random.default_rng(seed)
    t_s = np.sort(np.arange(0.0, each_s * len(rates_hz), 0.04) + rng.uniform(0, 0.004))
    edges = each_s * np.arange(len(rates_hz) + 1)
    taken = np.interp(t_s + rng.uniform(0, late_s, len(t_s)), edges, np.cumsum([0.0, *(each_s * np.array(rates_hz))]))
    return t_s, np.floor(taken)


def test_a_steady_clock_has_no_break():
    for seed in range(20):
        assert find_breaks(*counted([198.6], each_s=120.0, seed=seed, late_s=0.02)) == [], seed


def test_final_times_follow_a_clock_that_changes():
    t_s, taken = counted((200.0, 202.0), late_s=0.0)
    clock = clock_of(200, np.rint(t_s * 1e9).astype(int), taken.astype(int))
    index = np.arange(int(taken[-1]))
    segment = np.zeros_like(index)
    true = np.interp(index + 1.0, [0, 4000, 8040], [0, 20, 40])
    off_s = clock.final()(segment, index) - true
    assert np.abs(off_s).max() < 0.004
    assert np.abs(off_s[np.abs(index - 4000) > 100]).max() < 0.0005
    assert np.abs(clock.times_s(segment, index) - true).max() > 0.02
