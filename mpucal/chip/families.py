"""Table of chips: one row for each family with its differences; registers.py has what they share.

A chip with the same registers is one more row, or one more identity in a row. Simulated chips use these rows too.

Source: RM-MPU-6000A r4.2, RM-MPU-9250A r1.4, PS-MPU-6000A r3.4, PS-MPU-9250A r1.0; each row names its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..errors import ChipError
from . import registers as reg

# A full FIFO may show a frame less than its size.
FIFO_SLACK_BYTES = 16


class Family(NamedTuple):
    """Family of chips that the driver treats alike.

    Attributes
    ----------
    name : name of a chip of unknown identity that behaves so. parts : WHO_AM_I and name of each part.
    source : document of its differences from the others.
    fifo_bytes : size of the FIFO after a reset.
    widest_fifo_bytes : size with both FIFO_SIZE bits of ACCEL_CONFIG2 set; None: these bits have no effect.
    fifo_en_frame : value of FIFO_EN for a whole frame. has_i2c_if : True if I2C is switched off in a register of its
        own, and the accelerometer's bit of FIFO_EN adds the temperature.
    lsb_per_c, zero_c : temperature is counts / lsb_per_c + zero_c.
    accel_offset_h : addresses of the high bytes of the accelerometer offsets x, y, z; the low byte follows.
    accel_offset_lsb_per_g : nominal scale of such a 16-bit word; bit 0 is reserved.
    gyro_range_shift : position of FS_SEL in GYRO_CONFIG.
    has_accel_config2 : True if the accelerometer's filter has its own register, ACCEL_CONFIG2.
    packed_self_test : True if the factory's self-test codes are 5 bits each in SELF_TEST_ACCEL and the three registers
        after it; otherwise 8 bits each, from SELF_TEST_GYRO and from SELF_TEST_ACCEL on.
    asleep : True if it sleeps after power-on and reset.
    fifo_reset_needs_stop : FIFO_RESET acts only while FIFO_EN of USER_CTRL is 0 (RM-MPU-6000A, register 106).
    accel_lag_ms : delay of the accelerometer's filter less that of the gyroscope's, by DLPF_CFG, to the millisecond;
        empty: not documented.
    half_range_revision : letter of a revision whose accelerometer has half the sensitivity; empty: there is none.
    accel_noise_ug, gyro_noise_dps : typical noise densities, ug/sqrt(Hz) and deg/s/sqrt(Hz).
    zero_rate_dps : tolerance of the gyroscope's output at rest, deg/s. zero_g_mg : of the accelerometer's x, y, z, mg.
    scale_percent, cross_axis_percent : tolerances of the scale factors and cross-axis sensitivities of both.
    data_sheet : document of the accelerometer's tolerances; empty: unknown. nonlinearity_percent : of its range.
    spi_data_hz : fastest SPI clock for the data registers and the FIFO; 1 MHz for all other registers.
    zero_g_drift : drift of the output at 0 g with temperature, in words.
    """

    name: str
    source: str
    parts: tuple[tuple[int, str], ...]
    fifo_bytes: int
    lsb_per_c: float
    zero_c: float
    accel_offset_h: tuple[int, int, int]
    has_accel_config2: bool
    packed_self_test: bool
    asleep: bool
    accel_noise_ug: float
    gyro_noise_dps: float
    zero_rate_dps: float
    accel_offset_lsb_per_g: float = 2048.0
    widest_fifo_bytes: int | None = None
    fifo_en_frame: int = reg.FIFO_EN_FRAME
    has_i2c_if: bool = False
    gyro_range_shift: int = reg.FULL_SCALE_SHIFT
    fifo_reset_needs_stop: bool = False
    accel_lag_ms: tuple[int, ...] = ()
    half_range_revision: str = ""
    zero_g_mg: tuple[float, float, float] = (60.0, 60.0, 80.0)
    scale_percent: float = 3.0
    cross_axis_percent: float = 2.0
    data_sheet: str = ""
    nonlinearity_percent: float = 0.5
    spi_data_hz: int = 8_000_000
    zero_g_drift: str = ""

    @property
    def misalignment_deg(self) -> float:
        """Tolerance of an angle between the sensitive axes and the chip's, by the cross-axis sensitivity."""
        return math.degrees(math.atan(0.01 * self.cross_axis_percent))

    def accel_lag_s(self, dlpf_cfg: int) -> float:
        """Return the time by which the accelerometer lags behind the gyroscope; 0 if not documented."""
        return 1e-3 * self.accel_lag_ms[dlpf_cfg] if dlpf_cfg < len(self.accel_lag_ms) else 0.0


class Part(NamedTuple):
    """Part that can be bought.

    Attributes
    ----------
    chip : its name. who_am_i : its answer to WHO_AM_I. family : its row of the table.
    accel_sensitivity : accelerometer counts a g, relative to the nominal; a half-range revision has 0.5.
    wide_fifo_bytes : size of its FIFO with both FIFO_SIZE bits set, if that is larger.
    """

    chip: str
    who_am_i: int
    family: Family
    accel_sensitivity: float = 1.0
    wide_fifo_bytes: int | None = None

    @property
    def fifo_bytes(self) -> int:
        """Size of its FIFO as this driver configures it: the larger one; 0: no FIFO."""
        return self.wide_fifo_bytes or self.family.fifo_bytes


MPU6050 = Family(
    name="MPU-6050",
    source="RM-MPU-6000A r4.2",
    parts=((0x68, "MPU-6050"),),
    fifo_bytes=1024,
    lsb_per_c=340.0,
    zero_c=36.53,
    accel_offset_h=(0x06, 0x08, 0x0A),
    has_accel_config2=False,
    packed_self_test=True,
    asleep=True,
    accel_noise_ug=400.0,
    gyro_noise_dps=0.005,
    zero_rate_dps=20.0,
    zero_g_mg=(50.0, 50.0, 80.0),
    fifo_reset_needs_stop=True,
    # register 26: 0 and 0.98 ms at 0, 4.9 and 4.8 ms at 3, no more than 0.4 ms apart elsewhere
    accel_lag_ms=(-1, 0, 0, 0, 0, 0, 0),
    half_range_revision="C",
    data_sheet="PS-MPU-6000A r3.4",
    spi_data_hz=20_000_000,
    zero_g_drift="±35 mg (x, y) and ±60 mg (z) from 0 to 70 °C",
)

MPU6500 = Family(
    name="MPU-6500",
    source="RM-MPU-9250A r1.4; FIFO_SIZE: InvenSense's MotionDriver 6.12, PX4's MPU-9250 driver",
    parts=((0x70, "MPU-6500"), (0x71, "MPU-9250"), (0x73, "MPU-9255"), (0x74, "MPU-6515")),
    fifo_bytes=512,
    lsb_per_c=333.87,
    zero_c=21.0,
    accel_offset_h=(0x77, 0x7A, 0x7D),
    widest_fifo_bytes=4096,
    has_accel_config2=True,
    packed_self_test=False,
    asleep=False,
    accel_noise_ug=300.0,
    gyro_noise_dps=0.01,
    zero_rate_dps=5.0,
    # registers 26 and 29: 1.88 and 0.97 ms at 0, 4.88 and 5.9 ms at 3, 32.48 and 33.48 ms at 6
    accel_lag_ms=(1, -1, -1, -1, -1, -1, -1),
    data_sheet="PS-MPU-9250A r1.0",
    spi_data_hz=20_000_000,
    zero_g_drift="±1.5 mg/°C",
)

MPU6880 = MPU6500._replace(
    name="MPU-6880",
    source="Linux 6.1, inv_mpu_core.c",
    parts=((0x78, "MPU-6880"),),
    fifo_bytes=4096,
    widest_fifo_bytes=None,
    data_sheet="",
    zero_g_drift="",
)

ICM20689 = MPU6500._replace(
    name="ICM-20689",
    source="DS-000143 (ICM-20689); Linux 6.1, inv_mpu_core.c",
    parts=(
        (0x98, "ICM-20689"),
        (0xA6, "ICM-20609"),
        (0xA9, "IAM-20680"),
        (0xAE, "ICM-20608D"),
        (0xAF, "ICM-20608"),
    ),
    lsb_per_c=326.8,
    zero_c=25.0,
    asleep=True,
    accel_lag_ms=(),
    data_sheet="",
    spi_data_hz=8_000_000,
    zero_g_drift="",
)

ICM20690 = ICM20689._replace(
    name="ICM-20690",
    source="Linux 6.1, inv_mpu_core.c: INV_ICM20690_GYRO_CONFIG_FSR_SHIFT, fifo_size",
    parts=((0x20, "ICM-20690"),),
    widest_fifo_bytes=1024,
    gyro_range_shift=2,
)

ICM20602 = ICM20689._replace(
    name="ICM-20602",
    source="DS-000176 (ICM-20602), register 35; PX4's ICM-20602 driver",
    parts=((0x12, "ICM-20602"), (0x11, "ICM-20600")),
    fifo_bytes=1008,
    widest_fifo_bytes=None,
    fifo_en_frame=reg.FIFO_EN_ZG | reg.FIFO_EN_ACCEL,
    has_i2c_if=True,
)

MPU6886 = ICM20602._replace(
    name="MPU-6886",
    source="M5Stack's MPU6886 driver; data sheet DS-000193",
    parts=((0x19, "MPU-6886"),),
    fifo_bytes=1024,
)

FAMILIES = (MPU6050, MPU6500, MPU6880, ICM20689, ICM20690, ICM20602, MPU6886)

PARTS = {who_am_i: Part(chip, who_am_i, family) for family in FAMILIES for who_am_i, chip in family.parts}


def part_of(who_am_i: int) -> Part:
    """Return the part that answers `who_am_i`.

    Raises
    ------
    ChipError : no known part answers that.
    """
    try:
        return PARTS[who_am_i]
    except KeyError:
        raise ChipError(
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I, as no known part does",
            f"check which chip is at this address (known are {known_parts()})",
        ) from None


def part_named(chip: str | None) -> Part | None:
    """Return the part of that name, in which case and hyphens do not count; None if there is none."""
    name = (chip or "").replace("-", "").lower()
    return next((part for part in PARTS.values() if part.chip.replace("-", "").lower() == name), None)


def family_of(chip: str | None) -> Family | None:
    """Return the family of the chip of that name; None if its data sheet is unknown."""
    part = part_named(chip)
    return part.family if part is not None and part.family.data_sheet else None


def known_parts() -> str:
    """Return all parts with their identities, for a message."""
    return ", ".join(f"0x{value:02x} {part.chip}" for value, part in sorted(PARTS.items()))


def families_with_fifo(fifo_bytes: int) -> tuple[Family, ...]:
    """Return the families whose FIFO has about `fifo_bytes`."""
    return tuple(family for family in FAMILIES if abs(fifo_bytes - family.fifo_bytes) <= FIFO_SLACK_BYTES)
