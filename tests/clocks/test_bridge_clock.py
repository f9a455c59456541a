import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.clocks.bridge_clock import WRAP_US, BridgeClock

S, MS, US = 1_000_000_000, 1_000_000, 1000


def shown(t_ns, start_us=0):
    return (t_ns // US + start_us) % WRAP_US


@given(
    start_us=st.integers(0, WRAP_US - 1),
    pauses_s=st.lists(st.floats(0.001, 2000.0), min_size=1, max_size=20),
    fast_ppm=st.floats(-5000, 5000),
    latency_ms=st.lists(st.floats(1, 30), min_size=20, max_size=20),
)
def test_counter_wraps_are_counted_over_pauses(start_us, pauses_s, fast_ppm, latency_ms):
    """Half an hour of silence and a resonator that is 0.5 % off are allowed; a wrap takes 71 minutes."""
    clock, true_ns, first = BridgeClock(), 0, None
    for pause_s, late_ms in zip(pauses_s, latency_ms, strict=False):
        true_ns += round(pause_s * S)
        bridge_ns = round(true_ns * (1 + fast_ppm * 1e-6))
        t_ns = clock.bus_time(shown(bridge_ns, start_us), true_ns + round(late_ms * MS) + 5 * S)
        first = t_ns - bridge_ns if first is None else first
        assert abs(t_ns - bridge_ns - first) <= US


@pytest.mark.parametrize("fast_ppm", [-5000, 0, 5000])
def test_the_present_time_of_the_bridge_is_estimated(fast_ppm):
    clock = BridgeClock()
    for i in range(2000):
        host_ns = i * 20 * MS
        bridge_ns = round(host_ns * (1 + fast_ppm * 1e-6))
        late_ns = (1 + 15 * (i % 7 > 0)) * MS
        clock.bus_time(shown(bridge_ns), host_ns + late_ns)
        if i > 10:
            assert clock.now(host_ns + late_ns) == pytest.approx(bridge_ns + late_ns, abs=4 * MS)


@pytest.mark.parametrize(("away_s", "shows_s"), [(0.3, 0.0), (0.3, 4000.0), (3.0, 0.2), (600.0, 2.0)])
def test_a_reset_takes_no_time_away(shows_s, away_s):
    clock = BridgeClock()
    for i in range(100):
        clock.bus_time(shown(i * 20 * MS), i * 20 * MS + MS)
    host_ns = 2 * S + round(away_s * S)
    clock.on_greeting(shown(round(shows_s * S)), host_ns)
    assert clock.bus_time(shown(round(shows_s * S) + S), host_ns + S) == pytest.approx(host_ns + S, abs=60 * MS)


def test_a_bridge_that_runs_at_half_speed_is_followed():
    """An emulated board on a busy machine does so; a wait for its time must end."""
    clock = BridgeClock()
    for i in range(2000):
        clock.bus_time(shown(i * 10 * MS), i * 20 * MS)
        assert 0 <= clock.now(i * 20 * MS) - i * 10 * MS <= 250 * MS
