"""Identities and what they mean."""

import pytest

from mpucal.chip.families import MPU6050, MPU6500, part_of
from mpucal.errors import ChipError


@pytest.mark.parametrize(
    ("who_am_i", "chip", "fifo_bytes", "first_offset"),
    [(0x68, "MPU-6050", 1024, 0x06), (0x70, "MPU-6500", 512, 0x77), (0x71, "MPU-9250", 512, 0x77)],
    ids=["6050", "6500", "9250"],
)
def test_an_identity_names_its_part(who_am_i, chip, fifo_bytes, first_offset):
    part = part_of(who_am_i)
    assert (part.chip, part.who_am_i) == (chip, who_am_i)
    assert part.family.fifo_bytes == fifo_bytes
    assert part.family.accel_offset_h[0] == first_offset


@pytest.mark.parametrize("who_am_i", [0x00, 0xFF, 0x72])
def test_an_unknown_identity_is_said_with_the_known_ones(who_am_i):
    with pytest.raises(ChipError, match=rf"0x{who_am_i:02x}.*0x68 MPU-6050.*0x70 MPU-6500"):
        part_of(who_am_i)


@pytest.mark.parametrize(
    ("family", "count", "celsius"),
    [(MPU6050, -521, 35.0), (MPU6050, 0, 36.53), (MPU6500, 0, 21.0), (MPU6500, 333.87 * 4, 25.0)],
)
def test_temperature_formula(family, count, celsius):
    """RM-MPU-6000A register 65, whose example is 35 C at -521; PS-MPU-9250A table 3."""
    assert count / family.lsb_per_c + family.zero_c == pytest.approx(celsius, abs=0.01)


def test_the_6500_has_strides_of_three_and_a_register_for_the_accelerometer_filter():
    assert MPU6500.accel_offset_h == (0x77, 0x7A, 0x7D)
    assert MPU6500.has_accel_config2
    assert not MPU6050.has_accel_config2
