"""IMU messages made into m/s^2, rad/s and their own clock's time.

HIGHRES_IMU (105) carries floats; RAW_IMU (27), SCALED_IMU (26), SCALED_IMU2 (116) and SCALED_IMU3 (129) carry whole
milli-g and mrad/s, which ArduPilot and PX4 truncate toward zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..arguments import LARGEST
from ..data import STANDARD_GRAVITY_MPS2
from .dialect import Message

Xyz = tuple[float, float, float]

ACC_LSB_MPS2 = STANDARD_GRAVITY_MPS2 / 1000.0
GYRO_LSB_RAD_S = 1e-3
HIGHRES_UPDATED = 0b111111  # HIGHRES_IMU_UPDATED_FLAGS: accelerometer and gyroscope
CENTIDEGREES = 100.0

HIGHRES, RAW = "HIGHRES_IMU", "RAW_IMU"
# of ArduPilot's dataflash logs: what HIGHRES_IMU is, of every IMU
DATAFLASH = "IMU"
SCALED = {"SCALED_IMU": 1, "SCALED_IMU2": 2, "SCALED_IMU3": 3}
MESSAGE_ID = {HIGHRES: 105, RAW: 27, "SCALED_IMU": 26, "SCALED_IMU2": 116, "SCALED_IMU3": 129}


class Stream(NamedTuple):
    """Which message of which IMU, counted from 1."""

    name: str
    imu: int

    @property
    def is_truncated(self) -> bool:
        """Whether its numbers are truncated to whole milli-g and mrad/s."""
        return self.name not in (HIGHRES, DATAFLASH)

    @property
    def unit_us(self) -> int:
        """What its times count, in us."""
        return 1000 if self.name in SCALED else 1


@dataclass(frozen=True)
class Reading:
    """One message's content.

    Attributes
    ----------
    stream : whose. time : of the vehicle's clock, in the stream's unit.
    acc : m/s^2. gyr : rad/s. temperature_c : NaN where unknown.
    """

    stream: Stream
    time: int
    acc: Xyz
    gyr: Xyz
    temperature_c: float


# 285 years in us, which a float holds exactly
LATEST = 1 << 53


def decode_reading(message: Message) -> Reading | None:
    """The content of an IMU message; None of another one, or where it has no new accelerations and rates."""
    read = _READ.get(message.get_type())
    content = None if read is None else read(message)
    # an instance that is not there is sent as zeros, which no sensor feels
    return content if content is not None and any(content.acc + content.gyr) and content.time < LATEST else None


def _highres(m: Message) -> Reading | None:
    acc, gyr = (m.xacc, m.yacc, m.zacc), (m.xgyro, m.ygyro, m.zgyro)
    if m.fields_updated & HIGHRES_UPDATED != HIGHRES_UPDATED or not all(abs(v) <= LARGEST for v in acc + gyr):
        return None
    return Reading(Stream(HIGHRES, m.id + 1), m.time_usec, acc, gyr, m.temperature)


def _raw(m: Message) -> Reading:
    return _whole(m, Stream(RAW, 1), m.time_usec)


def _scaled(m: Message) -> Reading:
    name = m.get_type()
    return _whole(m, Stream(name, SCALED[name]), m.time_boot_ms)


def _whole(m: Message, stream: Stream, time: int) -> Reading:
    # the extension field is 0 where it is not sent
    temperature_c = m.temperature / CENTIDEGREES if m.temperature else math.nan
    acc = (_centred(m.xacc, ACC_LSB_MPS2), _centred(m.yacc, ACC_LSB_MPS2), _centred(m.zacc, ACC_LSB_MPS2))
    gyr = (_centred(m.xgyro, GYRO_LSB_RAD_S), _centred(m.ygyro, GYRO_LSB_RAD_S), _centred(m.zgyro, GYRO_LSB_RAD_S))
    return Reading(stream, time, acc, gyr, temperature_c)


def _centred(count: int, lsb: float) -> float:
    """The middle of the values that truncate to `count`: half a step further from zero, and zero for zero."""
    return (count + math.copysign(0.5, count)) * lsb if count else 0.0


_READ: Mapping[str, Callable[[Message], Reading | None]] = {
    HIGHRES: _highres,
    RAW: _raw,
    **dict.fromkeys(SCALED, _scaled),
}
