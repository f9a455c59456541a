"""Stamps of arrival become the sensor's own clock with gaps at lost samples, and true times are unchanged."""

import numpy as np
import pytest

from mpucal.clocks.stamps import fit_clock

HZ, N = 199.7, 8000
TRUE = np.arange(N) / HZ


def late(seed, s):
    """Stamps that are late by this time on average."""
    return np.maximum.accumulate(TRUE + np.random.default_rng(seed).exponential(s, N))


def in_bursts(size):
    """Stamps of samples that arrive in bursts of `size`, with the last one."""
    return TRUE[np.minimum((np.arange(N) // size + 1) * size - 1, N - 1)]


def polled(size):
    """Stamps of samples that are read when a timer of `size` sample periods expires."""
    return np.ceil(np.arange(N) / size) * size / HZ


def held_back():
    """Stamps of a computer that is busy for 0.3 s now and then."""
    stamps = late(1, 1e-3)
    for first in range(500, N - 500, 1000):
        stamps[first : first + 60] = np.maximum(stamps[first : first + 60], stamps[first + 60])
    return np.maximum.accumulate(stamps)


STAMPS = {
    "1 ms": (late(1, 1e-3), 1e-4),
    "5 ms": (late(2, 5e-3), 5e-4),
    "bursts of 10": (in_bursts(10), 2e-3),
    "bursts of 32": (in_bursts(32) + 2e-4 * (np.arange(N) % 32), 3e-3),
    "bursts of 11 or 12": (polled(11.96), 1e-3),
    "rounded to 10 ms": (np.floor(TRUE * 100) / 100, 1e-3),
    "rounded to 1 s": (np.floor(TRUE), 5e-2),
    "a busy computer": (held_back(), 5e-4),
}


@pytest.mark.parametrize(("stamps", "within"), STAMPS.values(), ids=STAMPS)
def test_stamps_of_late_arrivals_become_even_times(stamps, within):
    found = fit_clock(stamps)
    assert found.rate_hz == pytest.approx(HZ, rel=2e-4)
    assert not found.gap.any()
    off = found.t - TRUE
    assert np.abs(off - np.median(off)).max() < within
    assert "without gaps" in found.remark


def test_lost_samples_are_gaps_at_their_places():
    lost = np.zeros(N, bool)
    for first in (700, 2000, 2080, 5000):
        lost[first : first + 5] = True
    # a logger that paused for 7.3 s
    true = TRUE + np.where(np.arange(N) >= 6500, 7.3, 0.0)
    stamps = np.maximum.accumulate(true + np.random.default_rng(3).exponential(3e-3, N))[~lost]
    found = fit_clock(stamps)
    begins = [int(np.count_nonzero(~lost[:at])) for at in (705, 2005, 2085, 5005, 6500)]
    assert np.flatnonzero(found.gap).tolist() == begins
    off = found.t - true[~lost]
    assert np.abs(off - np.median(off)).max() < 1.5e-3
    assert "with 5 gaps" in found.remark


@pytest.mark.parametrize("missing", [0.02, 0.05])
def test_an_even_clock_does_not_replace_stamps_between_which_single_samples_are_missing(missing):
    """An even clock would ignore the missing samples, and be wrong by tens of ms."""
    rng = np.random.default_rng(6)
    there = rng.random(N) > missing
    off = fit_clock(np.maximum.accumulate(TRUE + 1e-3 * rng.standard_normal(N))[there]).t - TRUE[there]
    assert np.std(off) < 1.5e-3


TIMES = {
    "even": TRUE,
    "rounded to 1 ms": np.round(TRUE, 3),
    "some left out": TRUE[np.random.default_rng(4).random(N) > 0.1],
    "whenever a program came to it": np.cumsum((1 + np.random.default_rng(5).exponential(0.3, N)) / HZ),
    "few": TRUE[:50],
}


@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_true_times_are_not_changed(times):
    found = fit_clock(times)
    assert (found.jitter_s, found.remark) == (0.0, "")
    np.testing.assert_array_equal(found.t, times)
    # a step over two missing samples or more is a gap
    np.testing.assert_array_equal(found.gap[1:], np.diff(times) > 2.5 * np.median(np.diff(times)))


@pytest.mark.parametrize("n", [100, 150, 1200])
@pytest.mark.parametrize("hz", [HZ, 4000.0])
@pytest.mark.parametrize("changes", [1, 2, 5, 40])
def test_few_changes_give_times_that_increase(n, hz, changes):
    found = fit_clock(np.floor(np.arange(n) * (changes + 1) / n) * n / (changes + 1) / hz)
    assert (np.diff(found.t) > 0.0).all()
