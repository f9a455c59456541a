"""Configurations that chips have, and the refusal of others."""

from dataclasses import replace

import pytest

from mpucal.chip.config import Config
from mpucal.chip.families import part_of
from mpucal.errors import UsageError


@pytest.mark.parametrize(
    ("chosen", "allowed"),
    [
        pytest.param({"accel_range_g": 3}, "2, 4, 8, 16 g", id="accelerometer range"),
        pytest.param({"gyro_range_dps": 300}, "250, 500, 1000, 2000 deg/s", id="gyroscope range"),
        pytest.param({"dlpf": 7}, "0, 1, 2, 3, 4, 5, 6", id="filter"),
        pytest.param({"rate_hz": 300}, "333.333 Hz", id="rate"),
        pytest.param({"rate_hz": 1000, "poll_s": 0.05}, "0.001 to 0.024 s", id="polled too seldom"),
        pytest.param({"poll_s": 0}, "0.001 to 0.12 s", id="polled all the time"),
    ],
)
def test_an_impossible_value_is_refused_with_the_possible_ones(chosen, allowed):
    with pytest.raises(UsageError, match=allowed):
        Config(**chosen)


@pytest.mark.parametrize(("asked_g", "afs_sel"), [(2, 0), (4, 0), (8, 1), (16, 2)])
def test_half_the_sensitivity_still_gets_the_requested_range(asked_g, afs_sel):
    half = replace(part_of(0x68), accel_sensitivity=0.5)
    settings = Config(accel_range_g=asked_g).settings(half)
    assert settings.afs_sel == afs_sel
    assert settings.sensor.accel_range_g == max(asked_g, 4)
