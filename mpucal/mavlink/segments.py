"""Stretches of one vehicle's log joined into one: over a reboot, and over a change of the parameters that correct.

With known corrections, what an IMU delivered under one is turned into what it would have delivered under another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..data import Vector
from .firmwares import PX4
from .parameters.compose import Correction
from .parameters.names import AXES, Slot, find_slot, mounting, px4_slot
from .stream_buffers import StreamBuffers

Values = Mapping[str, float]

# whose change alters the streams: beyond what is composed, or by a correction
MOUNTED = ("AHRS_ORIENTATION", "AHRS_CUSTOM", "CUST_ROT", "SENS_BOARD")
BEYOND = ("INS_GYR", *MOUNTED, "EKF2_IMU_CTRL")
ACCELEROMETER = ("INS_ACC", "CAL_ACC")
CORRECTIONS = (*ACCELEROMETER, "CAL_GYRO")
# PX4 tells of a change up to a second after it is in use; the parameters of one change come one after the other
LATE_US = {PX4: 1_500_000}
SETTLED_US = 500_000


@dataclass
class Segment:
    """A stretch under one set of parameters, between reboots; `rebooted`: it began with one."""

    parameters: dict[str, float]
    buffers: StreamBuffers = field(default_factory=StreamBuffers)
    rebooted: bool = False

    def __len__(self) -> int:
        return max((len(g) for g in self.buffers.streams.values()), default=0)


@dataclass(frozen=True)
class Recorrection:
    """What an IMU delivers, seen through another correction of the same mounting R_b.

    Attributes
    ----------
    rate : (3,) rad/s, by which its rates become greater, in the vehicle's axes.
    """

    now: Correction
    then: Correction
    R_b: Vector
    rate: Vector

    def acc(self, acc: Vector) -> Vector:
        """(..., 3) m/s^2."""
        return self.now.recorrect(self.then, self.R_b, acc)

    def gyr(self, gyr: Vector) -> Vector:
        """(..., 3) rad/s."""
        return np.asarray(gyr + self.rate)


def find_recorrection(firmware: str, imu: int, now: Values, then: Values) -> Recorrection | None:
    """From the stream of an IMU under `now` to the one under `then`; None where that is not known."""
    if any(now.get(name, value) != value for name, value in then.items() if name.startswith(BEYOND)):
        return None
    where = _place(firmware, imu, now, then)
    if where is None or 0 != now.get(where.sensor_id, 0) != then.get(where.sensor_id, 0) != 0:
        return None
    corrections, R_b = (
        (_correction(firmware, where, now), _correction(firmware, where, then)),
        mounting(firmware, where, now),
    )
    if corrections[0] is None or corrections[1] is None or R_b is None or not np.all(corrections[0].scale):
        return None
    rate = R_b @ (_gyro_offset(where, now, then) - _gyro_offset(where, then, now))
    return Recorrection(where.effective(corrections[0]), where.effective(corrections[1]), R_b, rate)


def _place(firmware: str, imu: int, now: Values, then: Values) -> Slot | None:
    """Where an IMU's correction is in both; PX4 names its sensors meanwhile in the slots of their numbers."""
    if firmware == PX4 and _ids(now) != _ids(then):
        return px4_slot(imu, imu - 1)
    return find_slot(firmware, imu, now)


def _correction(firmware: str, where: Slot, values: Values) -> Correction | None:
    """Of a sensor that PX4 does not name yet, none: it delivers what it measures."""
    if firmware == PX4 and values.get(where.sensor_id) == 0:
        return Correction(np.zeros(3), np.ones(3))
    return where.correction(values)


def _gyro_offset(where: Slot, values: Values, otherwise: Values) -> Vector:
    """(3,) rad/s that PX4 subtracts; what was never told has not changed."""
    names = [where.sensor_id.replace("ACC", "GYRO").replace("ID", f"{axis}OFF") for axis in AXES]
    return np.array([values.get(name, otherwise.get(name, 0.0)) for name in names])


def join_segments(segments: Sequence[Segment], firmware: str, over_reboots: bool) -> Segment:
    """The largest part of `segments` that can be joined, as one under the parameters of its last one."""
    runs = [[segments[0]]]
    for segment in segments[1:]:
        apart = segment.rebooted and not over_reboots
        runs += [[segment]] if apart or not _joins(runs[-1][-1], segment, firmware) else []
        if runs[-1][-1] is not segment:
            runs[-1].append(segment)
    run = max(runs, key=lambda run: sum(map(len, run)))
    follows = segments.index(run[-1]) + 1
    cut = follows < len(segments) and not segments[follows].rebooted
    if len(run) == 1 and not (cut and firmware in LATE_US):
        return run[0]
    made = StreamBuffers()
    for k, segment in enumerate(run):
        before = None if k == 0 or segment.rebooted else SETTLED_US
        next_cuts = cut if segment is run[-1] else not run[k + 1].rebooted
        _add(made, segment, run[-1].parameters, firmware, before, LATE_US.get(firmware) if next_cuts else None)
    return Segment(dict(run[-1].parameters), made)


def _joins(one: Segment, other: Segment, firmware: str) -> bool:
    imus = {stream.imu for segment in (one, other) for stream in segment.buffers.streams}
    if _shaping(one.parameters) == _shaping(other.parameters):
        return True
    return all(find_recorrection(firmware, imu, one.parameters, other.parameters) is not None for imu in imus)


def _add(
    made: StreamBuffers, segment: Segment, then: Values, firmware: str, skip_us: int | None, drop_us: int | None
) -> None:
    same = _shaping(segment.parameters) == _shaping(then)
    for stream, buffer in segment.buffers.streams.items():
        times_us, numbers = buffer.rows()
        if not len(times_us):
            continue
        first_us = times_us[0] + (skip_us or 0)
        kept = (times_us >= first_us) & (times_us <= times_us[-1] - (drop_us or 0))
        numbers = numbers[kept]
        turned = None if same else find_recorrection(firmware, stream.imu, segment.parameters, then)
        if turned is not None:
            numbers[:, :3], numbers[:, 3:6] = turned.acc(numbers[:, :3]), turned.gyr(numbers[:, 3:6])
        made.extend(stream, times_us[kept], numbers)


def _shaping(values: Values) -> dict[str, float]:
    return {name: value for name, value in values.items() if name.startswith((*BEYOND, *CORRECTIONS))}


def _ids(values: Values) -> dict[str, float]:
    return {name: value for name, value in values.items() if name.endswith("_ID") and name.startswith(ACCELEROMETER)}
