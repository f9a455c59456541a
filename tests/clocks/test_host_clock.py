"""Rate of a clock from pairs of times with delays."""

import numpy as np
import pytest

from mpucal.clocks.host_clock import RATE_TOLERANCE, HostClock, fit_pairs


def pairs(rng, seconds, ppm, drift_ppm_a_minute=0.0, burst_s=0.0, a_second=10):
    """(bus ns, host ns) of replies at irregular times; a burst holds all back until its end."""
    n = seconds * a_second
    host = (np.arange(n) + rng.uniform(size=n)) / a_second
    drifted = 0.5 * drift_ppm_a_minute * 1e-6 / 60 * host * (host - seconds)
    bus = host * (1 + ppm * 1e-6) + drifted
    heard = host + 1e-3 + rng.exponential(2e-4, len(host))
    if burst_s:
        phase = rng.uniform(0.0, burst_s)
        heard = np.ceil((heard - phase) / burst_s) * burst_s + phase
    return np.rint(bus * 1e9).astype(np.int64) + 5 * 10**12, np.rint(heard * 1e9).astype(np.int64) + 10**10


@pytest.mark.parametrize("burst_ms", [1, 16])
@pytest.mark.parametrize(("ppm", "drift"), [(0, 0), (-10000, -50)])
def test_half_a_minute_gives_the_rate_to_20_ppm(ppm, drift, burst_ms):
    rng = np.random.default_rng([abs(ppm), drift + 50, burst_ms])
    fits = [fit_pairs(*pairs(rng, 30, ppm, drift, burst_ms * 1e-3)) for _ in range(30)]
    errors = np.array([fit.ppm - ppm for fit in fits])
    claimed = np.array([fit.b_std for fit in fits]) * 1e6
    assert np.sqrt(np.mean(errors**2)) < 20
    assert 0.5 < np.sqrt(np.mean((errors / claimed) ** 2)) < 1.3


def test_times_are_those_of_the_host():
    clock, together = HostClock(), HostClock()
    assert not clock
    t_ns, host_ns = pairs(np.random.default_rng(1), 120, 5000, 50)
    for i in range(len(t_ns)):
        clock.add(t_ns[i : i + 1], host_ns[i : i + 1])
    together.add(t_ns, host_ns)
    assert clock.fit() == together.fit()
    host_s = clock.final()(t_ns * 1e-9)
    np.testing.assert_allclose(np.diff(host_s[[0, -1]]), np.diff(host_ns[[0, -1]]) * 1e-9, atol=2e-3)
    assert np.ptp(host_s - host_ns * 1e-9) < 5e-3
    at_s = t_ns[-1] * 1e-9
    assert clock.provisional_s(at_s + 10.0) - clock.provisional_s(at_s) == pytest.approx(10 / 1.005, abs=3e-3)


@pytest.mark.parametrize("share", [0.5, 0.9, 1.2])
def test_a_bridge_in_a_time_of_its_own_is_not_corrected(share):
    t_ns, host_ns = pairs(np.random.default_rng(3), 60, 0)
    fit = fit_pairs(t_ns, host_ns[0] + ((host_ns - host_ns[0]) * share).astype(np.int64))
    assert (fit.b, fit.b_std) == (0.0, RATE_TOLERANCE)


def test_a_host_clock_that_leaps_keeps_the_rate():
    t_ns, host_ns = pairs(np.random.default_rng(4), 60, 5000)
    host_ns[150:] += 900 * 10**9
    assert fit_pairs(t_ns, host_ns).ppm == pytest.approx(5000, abs=20)


@pytest.mark.parametrize("step_ms", [-400, 30])
def test_a_bridge_that_was_reset_keeps_its_rate(step_ms):
    """The bridge's time goes on from about the old one."""
    t_ns, host_ns = pairs(np.random.default_rng(5), 60, 5000, burst_s=0.016)
    kept = np.r_[0:200, 215 : len(t_ns)]
    t_ns, host_ns = t_ns[kept], host_ns[kept]
    t_ns[200:] += step_ms * 10**6
    fit = fit_pairs(t_ns, host_ns)
    assert fit.ppm == pytest.approx(5000, abs=max(20, 3e6 * fit.b_std))
    assert fit.b_std < 50e-6
