"""A vehicle's clock: wraps, reboots, time that is set, and packets that come late."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.clocks.vehicle_clock import Jump, VehicleClock

WRAP = 1 << 32


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
