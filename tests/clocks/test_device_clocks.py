"""Clocks of a vehicle and of a bridge: wraps, resets, time that is set, and messages that come late."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.clocks.device_clocks import WRAP, BridgeClock, Jump, VehicleClock

S, MS, US = 1_000_000_000, 1_000_000, 1000


def run(unit_us, pairs):
    """Return time and jump of each (raw, received [s])."""
    clock = VehicleClock(unit_us)
    return [clock.unwrap(raw, round(received * 1e9)) for raw, received in pairs]


@given(st.lists(st.integers(1, 60_000), min_size=1, max_size=50), st.integers(0, WRAP - 1), st.sampled_from([1, 1000]))
def test_a_counter_of_32_bits_is_unwrapped(steps, start, unit_us):
    true = [start]
    for step in steps:
        true.append(true[-1] + step)
    pairs = [(raw % WRAP, (raw - start) * unit_us * 1e-6) for raw in true]
    found = run(unit_us, pairs)
    assert [t_us for t_us, _ in found] == [raw * unit_us for raw in true]
    assert {jump for _, jump in found} == {Jump.NONE}


@pytest.mark.parametrize(
    ("before_s", "after_s", "jump"),
    [
        (500.0, 3.0, Jump.REBOOT),
        (5000.0, 0.0, Jump.REBOOT),
        (20.0, 1.7e9, Jump.NONE),
        (5.0, 4.5, Jump.LATE),
        (5.0, 5.5, Jump.NONE),
    ],
    ids=["reboot", "reboot after more than 2^32 us", "time of day set", "late packet", "in order"],
)
def test_jumps_are_distinguished(before_s, after_s, jump):
    (_, first), (_, second) = run(1, [(round(before_s * 1e6), 100.0), (round(after_s * 1e6), 100.5)])
    assert first is Jump.NONE
    assert second is jump


def test_time_goes_on_over_a_reset_and_a_late_packet_keeps_its_time():
    reset = run(1, [(10_000_000, 50.0), (2_000_000, 53.0), (2_010_000, 53.01)])
    assert [t_us for t_us, _ in reset] == [10_000_000, 13_000_000, 13_010_000]
    late = run(1000, [(1000, 1.0), (1030, 1.03), (1010, 1.031), (1040, 1.04)])
    assert [t_us for t_us, _ in late] == [1_000_000, 1_030_000, 1_010_000, 1_040_000]


def test_a_burst_that_is_read_late_is_not_a_clock_that_was_set():
    # no read from 100.5 s on for 300 s: the first packet of that time was kept, and the newest follow
    pairs = [(1_000_000, 100.5), (1_010_000, 400.5), (301_000_000, 400.51), (301_010_000, 400.52)]
    found = run(1, pairs)
    assert [t_us for t_us, _ in found] == [raw for raw, _ in pairs]
    assert {jump for _, jump in found} == {Jump.NONE}


def shown(t_ns, start_us=0):
    return (t_ns // US + start_us) % WRAP


@given(
    start_us=st.integers(0, WRAP - 1),
    pauses_s=st.lists(st.floats(0.001, 2000.0), min_size=1, max_size=20),
    fast_ppm=st.floats(-5000, 5000),
    latency_ms=st.lists(st.floats(1, 30), min_size=20, max_size=20),
)
def test_counter_wraps_are_counted_over_pauses(start_us, pauses_s, fast_ppm, latency_ms):
    """A counter wraps after 71 minutes: allow half an hour of silence, and a resonator that is 0.5 % off."""
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
