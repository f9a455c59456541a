"""What differs from one family of chips to the next, and which family an identity belongs to. Knows no bus.

Source: RM-MPU-6000A r4.2, RM-MPU-9250A r1.4, PS-MPU-6000A r3.4, PS-MPU-9250A r1.0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..errors import ChipError


@dataclass(frozen=True)
class Family:
    """Chips that one driver can treat alike.

    Attributes
    ----------
    name : for a message.
    fifo_bytes : size of the FIFO as this driver configures it.
    lsb_per_c, zero_c : temperature is counts / lsb_per_c + zero_c.
    accel_offset_h : addresses of the high bytes of the accelerometer offsets x, y, z; the low byte follows.
    accel_offset_lsb_per_g : what one count of such a 16-bit word is nominally; bit 0 is reserved.
    packed_self_test : the factory's self-test codes are 5 bits each in SELF_TEST_ACCEL and the three registers
        after it; otherwise 8 bits each, from SELF_TEST_GYRO and from SELF_TEST_ACCEL on.
    has_accel_config2 : the accelerometer's filter has a register of its own, ACCEL_CONFIG2.
    accel_delay_ms, gyro_delay_ms : group delay of the low-pass filter by DLPF_CFG = 0..6.
    """

    name: str
    fifo_bytes: int
    lsb_per_c: float
    zero_c: float
    accel_offset_h: tuple[int, int, int]
    accel_offset_lsb_per_g: float
    packed_self_test: bool
    has_accel_config2: bool
    accel_delay_ms: tuple[float, ...]
    gyro_delay_ms: tuple[float, ...]


@dataclass(frozen=True)
class Part:
    """One chip that can be bought.

    Attributes
    ----------
    chip : its name. who_am_i : what it answers to WHO_AM_I. family : how to treat it.
    accel_sensitivity : accelerometer counts a g, over the nominal; revision C of the 6050 has half.
    """

    chip: str
    who_am_i: int
    family: Family
    accel_sensitivity: float = 1.0


MPU6050 = Family(
    name="MPU-6050",
    fifo_bytes=1024,
    lsb_per_c=340.0,
    zero_c=36.53,
    accel_offset_h=(0x06, 0x08, 0x0A),
    accel_offset_lsb_per_g=2048.0,
    packed_self_test=True,
    has_accel_config2=False,
    accel_delay_ms=(0.0, 2.0, 3.0, 4.9, 8.5, 13.8, 19.0),
    gyro_delay_ms=(0.98, 1.9, 2.8, 4.8, 8.3, 13.4, 18.6),
)

MPU6500 = Family(
    name="MPU-6500",
    fifo_bytes=512,
    lsb_per_c=333.87,
    zero_c=21.0,
    accel_offset_h=(0x77, 0x7A, 0x7D),
    accel_offset_lsb_per_g=2048.0,
    packed_self_test=False,
    has_accel_config2=True,
    accel_delay_ms=(1.88, 1.88, 2.88, 4.88, 8.87, 16.83, 32.48),
    gyro_delay_ms=(0.97, 2.9, 3.9, 5.9, 9.9, 17.85, 33.48),
)

MPU6880 = replace(MPU6500, name="MPU-6880", fifo_bytes=4096)

# FIFO_SIZE in ACCEL_CONFIG2 could widen this FIFO to 4096 bytes; the driver leaves it at 0, 512 bytes.
CLONE98 = Family(
    name="ICM-20689",
    fifo_bytes=512,
    lsb_per_c=326.8,
    zero_c=25.0,
    accel_offset_h=MPU6500.accel_offset_h,
    accel_offset_lsb_per_g=MPU6500.accel_offset_lsb_per_g,
    packed_self_test=False,
    has_accel_config2=True,
    accel_delay_ms=MPU6500.accel_delay_ms,
    gyro_delay_ms=MPU6500.gyro_delay_ms,
)

PARTS = {
    part.who_am_i: part
    for part in (
        Part("MPU-6050", 0x68, MPU6050),
        Part("MPU-6500", 0x70, MPU6500),
        Part("MPU-9250", 0x71, MPU6500),
        Part("MPU-9255", 0x73, MPU6500),
        Part("MPU-6515", 0x74, MPU6500),
        Part("MPU-6880", 0x78, MPU6880),
        Part("ICM-20689", 0x98, CLONE98),
        Part("ICM-20600", 0x11, CLONE98),
        Part("ICM-20602", 0x12, CLONE98),
        Part("ICM-20690", 0x20, CLONE98),
        Part("IAM-20680", 0xA9, CLONE98),
        Part("ICM-20608D", 0xAE, CLONE98),
        Part("ICM-20608", 0xAF, CLONE98),
    )
}


def part_of(who_am_i: int) -> Part:
    """The part that answers `who_am_i`.

    Raises
    ------
    ChipError : no part that is known here answers that.
    """
    try:
        return PARTS[who_am_i]
    except KeyError:
        known = ", ".join(f"0x{value:02x} {part.chip}" for value, part in sorted(PARTS.items()))
        raise ChipError(
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I, which is no part that is known here",
            f"check which chip is at this address (known are {known})",
        ) from None
