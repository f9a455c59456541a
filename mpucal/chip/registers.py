"""Registers that the MPU-6000 and MPU-6500 families share: addresses, bits, ranges and sample rates.

Source: RM-MPU-6000A r4.2 and RM-MPU-9250A r1.4 (registers), PS-MPU-6000A r3.4 (scales). families.py has the
differences between the families.
"""

from __future__ import annotations

import math
from typing import Final

from .. import data
from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2
from ..errors import UsageError

# I2C addresses: with AD0 low, and with AD0 high; and those that I2C does not reserve
ADDRESSES = (0x68, 0x69)
USABLE_ADDRESSES = range(0x08, 0x78)

# The factory's self-test codes: three bytes each on a 6500, four packed bytes on a 6050.
SELF_TEST_GYRO: Final = 0x00
SELF_TEST_ACCEL: Final = 0x0D
XG_OFFSET_H: Final = 0x13
SMPLRT_DIV: Final = 0x19
CONFIG: Final = 0x1A
GYRO_CONFIG: Final = 0x1B
ACCEL_CONFIG: Final = 0x1C
ACCEL_CONFIG2: Final = 0x1D
FIFO_EN: Final = 0x23
INT_PIN_CFG: Final = 0x37
INT_ENABLE: Final = 0x38
INT_STATUS: Final = 0x3A
ACCEL_XOUT_H: Final = 0x3B
TEMP_OUT_H: Final = 0x41
SIGNAL_PATH_RESET: Final = 0x68
USER_CTRL: Final = 0x6A
PWR_MGMT_1: Final = 0x6B
PWR_MGMT_2: Final = 0x6C
FIFO_COUNT_H: Final = 0x72
FIFO_R_W: Final = 0x74
WHO_AM_I: Final = 0x75

# CONFIG
CONFIG_FIFO_MODE_STOP: Final = 0x40
CONFIG_DLPF_CFG: Final = 0x07

# GYRO_CONFIG and ACCEL_CONFIG: self test of x, y, z in [7:5], full scale in [4:3]
SELF_TEST: Final = 0xE0
FULL_SCALE_SHIFT: Final = 3
FULL_SCALE_CODES: Final = 0x03

# ACCEL_CONFIG2 (6500 only)
FIFO_SIZE: Final = 0xC0  # 512 bytes, doubled this many times, in chips whose FIFO grows
FIFO_SIZE_SHIFT: Final = 6

# FIFO_EN
FIFO_EN_TEMP: Final = 0x80
FIFO_EN_XG: Final = 0x40
FIFO_EN_YG: Final = 0x20
FIFO_EN_ZG: Final = 0x10
FIFO_EN_ACCEL: Final = 0x08
FIFO_EN_FRAME: Final = FIFO_EN_TEMP | FIFO_EN_XG | FIFO_EN_YG | FIFO_EN_ZG | FIFO_EN_ACCEL

# INT_ENABLE and INT_STATUS; reading INT_STATUS clears it
INT_DATA_RDY: Final = 0x01
INT_FIFO_OFLOW: Final = 0x10

# SIGNAL_PATH_RESET
SIGNAL_PATH_RESET_ALL: Final = 0x07

# USER_CTRL
USER_CTRL_FIFO_EN: Final = 0x40
USER_CTRL_FIFO_RESET: Final = 0x04
USER_CTRL_SIG_COND_RESET: Final = 0x01

# PWR_MGMT_1
PWR_MGMT_1_DEVICE_RESET: Final = 0x80
PWR_MGMT_1_SLEEP: Final = 0x40
CLKSEL_PLL: Final = 0x01

# One FIFO frame, in register order: accelerometer x, y, z, temperature, gyroscope x, y, z, big-endian int16.
FRAME_WORDS: Final = 7
FRAME_BYTES: Final = 2 * FRAME_WORDS

# Full scales by AFS_SEL and FS_SEL.
ACCEL_RANGES_G: Final = data.ACCEL_RANGES_G
GYRO_RANGES_DPS: Final = (250, 500, 1000, 2000)
ACCEL_LSB_PER_G: Final = tuple(ACCEL_COUNTS / full_scale for full_scale in ACCEL_RANGES_G)
GYRO_LSB_PER_DPS: Final = tuple(GYRO_COUNTS / full_scale for full_scale in GYRO_RANGES_DPS)

# The gyroscope's offset registers: one scale at every full scale.
GYRO_OFFSET_LSB_PER_DPS: Final = 32.75

DLPF_CODES: Final = tuple(range(CONFIG_DLPF_CFG))  # the last code is reserved
MAX_RATE_HZ: Final = 1000.0


def mps2_per_lsb(afs_sel: int) -> float:
    """Return the acceleration [m/s^2] of one count at full scale AFS_SEL = 0..3."""
    return STANDARD_GRAVITY_MPS2 / ACCEL_LSB_PER_G[afs_sel]


def rad_s_per_lsb(fs_sel: int) -> float:
    """Return the rate [rad/s] of one count at full scale FS_SEL = 0..3."""
    return math.radians(1.0) / GYRO_LSB_PER_DPS[fs_sel]


def base_rate_hz(dlpf_cfg: int) -> float:
    """Return the rate that SMPLRT_DIV divides (RM-MPU-6000A, register 25)."""
    return 1000.0 if 1 <= dlpf_cfg <= 6 else 8000.0


def sample_rate_hz(smplrt_div: int, dlpf_cfg: int) -> float:
    """Return the nominal sample rate."""
    return base_rate_hz(dlpf_cfg) / (1 + smplrt_div)


def sample_rate_divider(rate_hz: float, dlpf_cfg: int) -> int:
    """Return the SMPLRT_DIV for `rate_hz`.

    Raises
    ------
    UsageError : the chip does not have this rate; the message names the nearest that it has.
    """
    base = base_rate_hz(dlpf_cfg)
    divider = min(255, max(base / MAX_RATE_HZ - 1, round(base / rate_hz) - 1)) if rate_hz > 0 else 255
    nearest = sample_rate_hz(int(divider), dlpf_cfg)
    if not math.isclose(nearest, rate_hz, rel_tol=1e-6):
        raise UsageError(
            f"the chip has no sample rate of {rate_hz:g} Hz with its low-pass filter at {dlpf_cfg}",
            f"use {nearest:g} Hz, or another {base:g} Hz / n from {base / 256:.4g} to {MAX_RATE_HZ:g} Hz",
            f"--rate {nearest:g}",
        )
    return int(divider)
