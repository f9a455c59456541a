"""Content of a chip's registers as they are: nothing is reset, set up or written.

Source: RM-MPU-6000A r4.2, registers 27, 28, 59 to 66, 107 and 117.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2
from . import registers as reg
from .access import Bus
from .families import PARTS
from .offsets import PLACES, OffsetRegisters
from .port import Port


def chip_contents(bus: Bus) -> dict[str, Any]:
    """Read identity, ranges, offset registers and, if the chip is known and awake, one sample (m/s^2, deg C).

    The values are of JSON's types.

    Raises
    ------
    BusError : a transfer failed.
    """
    port = Port(bus)
    who_am_i = port.read(reg.WHO_AM_I, 1)[0]
    gyro, accel = port.read(reg.GYRO_CONFIG, 2)
    asleep = bool(port.read(reg.PWR_MGMT_1, 1)[0] & reg.PWR_MGMT_1_SLEEP)
    part = PARTS.get(who_am_i)
    shift = reg.FULL_SCALE_SHIFT if part is None else part.family.gyro_range_shift
    scale = accel >> reg.FULL_SCALE_SHIFT & reg.FULL_SCALE_CODES
    facts: dict[str, Any] = {
        "who_am_i": who_am_i,
        "chip": None if part is None else part.chip,
        "asleep": asleep,
        "accel_range_g": reg.ACCEL_RANGES_G[scale],
        "gyro_range_dps": reg.GYRO_RANGES_DPS[gyro >> shift & reg.FULL_SCALE_CODES],
        "accel_offsets": {f"0x{place[0]:02x}": list(OffsetRegisters.read(port, place).words) for place in PLACES},
    }
    if asleep or part is None:
        return facts
    # The accelerometer's six bytes, then two of the temperature.
    data = np.frombuffer(port.read(reg.ACCEL_XOUT_H, 8), ">i2").astype(float)
    acc = data[:3] / reg.ACCEL_LSB_PER_G[scale] * STANDARD_GRAVITY_MPS2 / part.accel_sensitivity
    return facts | {
        "acc_mps2": acc.tolist(),
        "temperature_c": float(data[3] / part.family.lsb_per_c + part.family.zero_c),
    }
