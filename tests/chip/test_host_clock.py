"""A clock's rate from pairs of times, of which each was heard late."""

import numpy as np
import pytest

from mpucal.chip.host_clock import RATE_STD, HostClock, fitted


def pairs(rng, seconds, ppm, drift_ppm_a_minute=0.0, burst_s=0.0, a_second=10):
    """(bus ns, host ns) of looks at times that do not repeat; a burst holds all back until its end."""
    host = np.sort(rng.uniform(0.0, seconds, seconds * a_second))
    drifted = 0.5 * drift_ppm_a_minute * 1e-6 / 60 * host * (host - seconds)
    bus = host * (1 + ppm * 1e-6) + drifted
    heard = host + 1e-3 + rng.exponential(2e-4, len(host))
    if burst_s:
        phase = rng.uniform(0.0, burst_s)
        heard = np.ceil((heard - phase) / burst_s) * burst_s + phase
    return np.rint(bus * 1e9).astype(np.int64) + 5 * 10**12, np.rint(heard * 1e9).astype(np.int64) + 10**10


def fit_of(t_ns, host_ns):
    return fitted({"look": (t_ns, host_ns)})


@pytest.mark.parametrize("burst_ms", [1, 4, 16])
@pytest.mark.parametrize(("ppm", "drift"), [(0, 0), (5000, 50), (-10000, -50), (10000, 0)])
def test_half_a_minute_tells_the_rate_to_20_ppm(ppm, drift, burst_ms):
    rng = np.random.default_rng([abs(ppm), drift + 50, burst_ms])
    fits = [fit_of(*pairs(rng, 30, ppm, drift, burst_ms * 1e-3)) for _ in range(60)]
    errors = np.array([fit.ppm - ppm for fit in fits])
    claimed = np.array([fit.b_std for fit in fits]) * 1e6
    assert np.sqrt(np.mean(errors**2)) < 20
    assert 0.6 < np.sqrt(np.mean((errors / claimed) ** 2)) < 1.3


def test_times_are_those_of_the_host():
    clock = HostClock()
    t_ns, host_ns = pairs(np.random.default_rng(1), 120, 5000, 50)
    for t, host in zip(t_ns.tolist(), host_ns.tolist(), strict=True):
        clock.saw("look", t, host)
    host_s = clock.final()(t_ns * 1e-9)
    np.testing.assert_allclose(np.diff(host_s[[0, -1]]), np.diff(host_ns[[0, -1]]) * 1e-9, atol=2e-3)
    assert np.ptp(host_s - host_ns * 1e-9) < 5e-3
    assert clock.provisional_s(t_ns[-1] * 1e-9 + 10.0) - clock.provisional_s(t_ns[-1] * 1e-9) == pytest.approx(
        10 / 1.005, abs=3e-3
    )


def test_without_pairs_it_is_the_hosts():
    clock = HostClock()
    assert not clock
    t_s = np.array([1.0, 2.5])
    assert clock.final()(t_s) is t_s


def test_a_few_pairs_tell_nothing():
    fit = fit_of(*pairs(np.random.default_rng(2), 1, 5000))
    assert (fit.b, fit.b_std) == (0.0, RATE_STD)


@pytest.mark.parametrize("share", [0.5, 0.9, 1.2])
def test_a_bridge_in_a_time_of_its_own_is_not_corrected(share):
    t_ns, host_ns = pairs(np.random.default_rng(3), 60, 0)
    fit = fit_of(t_ns, host_ns[0] + ((host_ns - host_ns[0]) * share).astype(np.int64))
    assert (fit.b, fit.b_std) == (0.0, RATE_STD)


def test_a_clock_that_began_anew_keeps_its_rate():
    rng = np.random.default_rng(4)
    t_ns, host_ns = pairs(rng, 60, 5000)
    host_ns[150:] += 900 * 10**9
    fit = fit_of(t_ns, host_ns)
    assert fit.ppm == pytest.approx(5000, abs=20)
