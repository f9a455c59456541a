"""Arithmetic of the register maps against the data sheets, and configurations converted to registers and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.config import Config, Settings
from mpucal.chip.families import MPU6050, MPU6500, PARTS, part_of
from mpucal.errors import ChipError, RecordingError, UsageError

settings = st.builds(
    Settings,
    part=st.sampled_from(sorted(PARTS)).map(part_of),
    smplrt_div=st.integers(0, 255),
    dlpf_cfg=st.integers(0, 6),
    fs_sel=st.integers(0, 3),
    afs_sel=st.integers(0, 3),
)


@pytest.mark.parametrize(("fs_sel", "lsb_per_dps"), [(0, 131), (1, 65.5), (2, 32.8), (3, 16.4)])
def test_gyroscope_scale(fs_sel, lsb_per_dps):
    assert lsb_per_dps * reg.rad_s_per_lsb(fs_sel) == pytest.approx(math.radians(1), rel=2e-3)


@pytest.mark.parametrize(
    ("rate_hz", "dlpf_cfg", "divider"),
    [
        pytest.param(1000, 1, 0, id="the fastest"),
        pytest.param(1000, 0, 7, id="from 8 kHz"),
        pytest.param(1000 / 256, 6, 255, id="the slowest"),
        pytest.param(333.33333, 3, 2, id="a third"),
    ],
)
def test_divider_of_a_rate_and_back(rate_hz, dlpf_cfg, divider):
    assert reg.sample_rate_divider(rate_hz, dlpf_cfg) == divider
    assert reg.sample_rate_hz(divider, dlpf_cfg) == pytest.approx(rate_hz)


@pytest.mark.parametrize(
    ("family", "count", "celsius"),
    [(MPU6050, -521, 35.0), (MPU6050, 0, 36.53), (MPU6500, 0, 21.0), (MPU6500, 333.87 * 4, 25.0)],
)
def test_temperature_formula(family, count, celsius):
    """Sources: RM-MPU-6000A register 65, whose example is 35 C at -521; PS-MPU-9250A table 3."""
    assert count / family.lsb_per_c + family.zero_c == pytest.approx(celsius, abs=0.01)


@given(settings, st.integers(0, 255))
def test_other_bits_of_the_registers_do_not_matter(chosen, noise):
    held = chosen.registers()
    held[reg.CONFIG] |= noise & 0x78
    # a wider range field, as the ICM-20690 has, is set by its own bits
    held[reg.GYRO_CONFIG] |= noise & 0xE3
    held[reg.ACCEL_CONFIG] |= noise & 0xE7
    assert Settings.from_registers(held, chosen.part) == chosen


def test_register_values_of_the_map():
    chosen = Settings(part_of(0x70), smplrt_div=4, dlpf_cfg=3, fs_sel=1, afs_sel=2)
    assert chosen.registers() == {0x6C: 0, 0x38: 0x10, 0x19: 4, 0x1A: 3, 0x1B: 0x08, 0x1C: 0x10, 0x1D: 3}
    assert (chosen.sensor.gyro_range_dps, chosen.sensor.accel_range_g) == (500, 8)
    with pytest.raises(RecordingError, match=r"cut\.mcap.*0x19, 0x1b"):
        Settings.from_registers({reg.CONFIG: 3, reg.ACCEL_CONFIG: 0}, part_of(0x68), "cut.mcap")


@pytest.mark.parametrize(
    ("who_am_i", "dlpf", "lag_s"), [(0x68, 3, 0.0), (0x68, 0, -0.001), (0x71, 3, -0.001), (0x98, 3, 0)]
)
def test_lag_of_the_accelerometers_filter(who_am_i, dlpf, lag_s):
    assert Settings(part_of(who_am_i), 4, dlpf, 1, 2).sensor.accel_lag_s == lag_s


@pytest.mark.parametrize(
    ("chosen", "allowed"),
    [
        pytest.param({"accel_range_g": 3}, "2, 4, 8, 16 g", id="accelerometer range"),
        pytest.param({"gyro_range_dps": 300}, "250, 500, 1000, 2000 deg/s", id="gyroscope range"),
        pytest.param({"dlpf": 7}, "0, 1, 2, 3, 4, 5, 6", id="filter"),
        pytest.param({"rate_hz": 300}, "333.333 Hz", id="rate"),
        pytest.param({"rate_hz": 1000, "poll_s": 0.06}, "0.001 to 0.054 s", id="polled too seldom"),
        pytest.param({"poll_s": 0}, "0.001 to 0.27 s", id="polled all the time"),
    ],
)
def test_an_impossible_value_is_refused_with_the_possible_ones(chosen, allowed):
    with pytest.raises(UsageError, match=allowed):
        Config(**chosen)


def test_an_unknown_identity_is_refused_with_the_known_ones():
    with pytest.raises(ChipError, match=r"0x72.*0x68 MPU-6050.*0x70 MPU-6500"):
        part_of(0x72)
