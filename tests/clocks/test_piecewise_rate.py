"""Piecewise lines against those of which the points were made."""

import numpy as np

from mpucal.clocks.piecewise_rate import find_breaks
from mpucal.clocks.sample_clock import SampleClock


def counted(rates_hz, each_s=20.0, seed=0, late_s=0.001):
    """Times and counts of looks every 40 ms at a chip whose rate changes every `each_s`."""
    rng = np.random.default_rng(seed)
    t_s = np.sort(np.arange(0.0, each_s * len(rates_hz), 0.04) + rng.uniform(0, 0.004))
    edges = each_s * np.arange(len(rates_hz) + 1)
    taken = np.interp(t_s + rng.uniform(0, late_s, len(t_s)), edges, np.cumsum([0.0, *(each_s * np.array(rates_hz))]))
    return t_s, np.floor(taken)


def clock_of(t_s, y):
    clock = SampleClock(200.0)
    clock.begin_segment()
    clock.add(np.rint(t_s * 1e9).astype(np.int64), y.astype(np.int64))
    index = np.arange(int(y[-1]))
    return clock, index, np.zeros_like(index)


def test_a_steady_clock_has_no_break():
    for seed in range(20):
        assert find_breaks(*counted([198.6], each_s=120.0, seed=seed, late_s=0.02)) == [], seed


def test_final_times_follow_a_clock_that_changes():
    clock, index, segment = clock_of(*counted((200.0, 202.0), late_s=0.0))
    true = np.interp(index + 1.0, [0, 4000, 8040], [0, 20, 40])
    off_s = clock.final()(segment, index) - true
    assert np.abs(off_s).max() < 0.004
    assert np.abs(off_s[np.abs(index - 4000) > 100]).max() < 0.0005
    assert np.abs(clock.times_s(segment, index) - true).max() > 0.02
