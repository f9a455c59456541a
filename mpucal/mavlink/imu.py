"""IMU messages in m/s^2 and rad/s, with the time of their own clock.

HIGHRES_IMU (105) carries floats; RAW_IMU (27), SCALED_IMU (26), SCALED_IMU2 (116) and SCALED_IMU3 (129) carry whole
milli-g and mrad/s, which ArduPilot and PX4 truncate toward zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..arguments import LARGEST
from ..data import STANDARD_GRAVITY_MPS2
from .dialect import Message

Xyz = tuple[float, float, float]

ACC_LSB_MPS2 = STANDARD_GRAVITY_MPS2 / 1000.0
GYRO_LSB_RAD_S = 1e-3
HIGHRES_UPDATED = 0b111111  # HIGHRES_IMU_UPDATED_FLAGS of accelerometer and gyroscope

HIGHRES, RAW = "HIGHRES_IMU", "RAW_IMU"
# In ArduPilot's dataflash logs this message has floats of every IMU.
DATAFLASH = "IMU"
SCALED = {"SCALED_IMU": 1, "SCALED_IMU2": 2, "SCALED_IMU3": 3}
MESSAGE_ID = {HIGHRES: 105, RAW: 27, "SCALED_IMU": 26, "SCALED_IMU2": 116, "SCALED_IMU3": 129}

# 285 years in us, which a float holds exactly
LATEST = 1 << 53


class Stream(NamedTuple):
    """A message by name, of one IMU, counted from 1."""

    name: str
    imu: int

    @property
    def is_truncated(self) -> bool:
        """True if its numbers are truncated to whole milli-g and mrad/s."""
        return self.name not in (HIGHRES, DATAFLASH)

    @property
    def unit_us(self) -> int:
        """Unit of its times in us."""
        return 1000 if self.name in SCALED else 1


class Reading(NamedTuple):
    """Content of one IMU message.

    Attributes
    ----------
    stream : of the message. time : of the vehicle's clock, in the stream's unit.
    acc : m/s^2. gyr : rad/s. temperature_c : NaN if unknown.
    """

    stream: Stream
    time: int
    acc: Xyz
    gyr: Xyz
    temperature_c: float


def live_stream(name: str, imu: int) -> Stream:
    """Return the stream that shows IMU `imu` of a vehicle whose recording holds messages `name`.

    An ArduPilot logs its messages IMU, and streams the same numbers as RAW_IMU, SCALED_IMU2 and SCALED_IMU3.
    """
    if name in MESSAGE_ID:
        return Stream(name, SCALED.get(name, imu))
    return Stream(RAW if imu == 1 else f"SCALED_IMU{imu}", imu)


def decode_reading(message: Message) -> Reading | None:
    """Return the content of an IMU message, or None if it has no new accelerations and rates or is another message."""
    name = message.get_type()
    if name not in MESSAGE_ID:
        return None
    content = _highres(message) if name == HIGHRES else _truncated(message, name)
    # An IMU that does not exist is sent as zeros, which no sensor measures.
    return content if content is not None and any(content.acc + content.gyr) and content.time < LATEST else None


def _highres(m: Message) -> Reading | None:
    acc, gyr = (m.xacc, m.yacc, m.zacc), (m.xgyro, m.ygyro, m.zgyro)
    if m.fields_updated & HIGHRES_UPDATED != HIGHRES_UPDATED or not all(abs(v) <= LARGEST for v in acc + gyr):
        return None
    return Reading(Stream(HIGHRES, m.id + 1), m.time_usec, acc, gyr, m.temperature)


def _truncated(m: Message, name: str) -> Reading:
    # The temperature [0.01 degrees] is an extension field, which is 0 if it was not sent.
    temperature_c = m.temperature / 100 if m.temperature else math.nan
    acc = (_centred(m.xacc, ACC_LSB_MPS2), _centred(m.yacc, ACC_LSB_MPS2), _centred(m.zacc, ACC_LSB_MPS2))
    gyr = (_centred(m.xgyro, GYRO_LSB_RAD_S), _centred(m.ygyro, GYRO_LSB_RAD_S), _centred(m.zgyro, GYRO_LSB_RAD_S))
    time = m.time_boot_ms if name in SCALED else m.time_usec
    return Reading(Stream(name, SCALED.get(name, 1)), time, acc, gyr, temperature_c)


def _centred(count: int, lsb: float) -> float:
    """Return the middle of the values that truncate to `count`: half a step further from zero, and zero for zero."""
    return (count + math.copysign(0.5, count)) * lsb if count else 0.0
