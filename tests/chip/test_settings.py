"""Settings converted to registers and back."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.families import PARTS, part_of
from mpucal.chip.settings import Settings
from mpucal.errors import RecordingError

settings = st.builds(
    Settings,
    part=st.sampled_from(sorted(PARTS)).map(part_of),
    smplrt_div=st.integers(0, 255),
    dlpf_cfg=st.integers(0, 6),
    fs_sel=st.integers(0, 3),
    afs_sel=st.integers(0, 3),
    accel_only=st.booleans(),
)


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
    assert reg.ACCEL_CONFIG2 not in replace(chosen, part=part_of(0x68)).registers()
    assert chosen.nominal_rate_hz == 200
    assert (chosen.sensor.gyro_range_dps, chosen.sensor.accel_range_g) == (500, 8)


@pytest.mark.parametrize(
    ("who_am_i", "dlpf", "lag_s"), [(0x68, 3, 0.0), (0x68, 0, -0.001), (0x71, 3, -0.001), (0x98, 3, 0)]
)
def test_lag_of_the_accelerometers_filter(who_am_i, dlpf, lag_s):
    assert Settings(part_of(who_am_i), 4, dlpf, 1, 2).sensor.accel_lag_s == lag_s


def test_missing_registers_are_named():
    with pytest.raises(RecordingError, match=r"cut\.mcap.*0x19, 0x1b"):
        Settings.from_registers({reg.CONFIG: 3, reg.ACCEL_CONFIG: 0}, part_of(0x68), "cut.mcap")
