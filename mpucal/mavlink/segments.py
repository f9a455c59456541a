"""Segments of one vehicle's log, joined over reboots and over changes of the parameters that correct its streams.

With known corrections, the output of an IMU under one is transformed to its output under another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .firmwares import EKF2_IMU_CTRL, PX4
from .parameters.mounting import mounting
from .parameters.slots import Correction, Slot, Values, find_slot, px4_slot
from .stream_buffers import Segment

# Prefixes of parameters whose change alters the streams: in a way that is not transformed, or by a correction.
FIXED = ("INS_GYR", "AHRS_ORIENTATION", "AHRS_CUSTOM", "CUST_ROT", "SENS_BOARD", EKF2_IMU_CTRL)
ACCELEROMETER = ("INS_ACC", "CAL_ACC")
ALTERING = (*FIXED, *ACCELEROMETER, "CAL_GYRO")
# PX4 reports a change up to a second after its streams have it; the parameters of one change come one by one.
LATE_US = {PX4: 1_500_000}
SETTLED_US = 500_000


@dataclass(frozen=True)
class Recorrection:
    """Transform of an IMU's output under one correction to its output under another, with the same mounting R_b.

    Attributes
    ----------
    now, then : the corrections before and after. rate : (3,) rad/s to add to the rates, in the vehicle's axes.
    """

    now: Correction
    then: Correction
    R_b: Vector
    rate: Vector

    def acc(self, acc: Vector) -> Vector:
        """Transform (..., 3) m/s^2."""
        return self.now.recorrect(self.then, self.R_b, acc)

    def gyr(self, gyr: Vector) -> Vector:
        """Transform (..., 3) rad/s."""
        return np.asarray(gyr + self.rate)


def find_recorrection(firmware: str, imu: int, now: Values, then: Values) -> Recorrection | None:
    """Return the transform of an IMU's stream under `now` to that under `then`, None if it is not known."""
    if any(now.get(name, value) != value for name, value in then.items() if name.startswith(FIXED)):
        return None
    slot = find_slot(firmware, imu, now)
    if firmware == PX4 and _ids(now) != _ids(then):
        # PX4 assigned ids meanwhile, in the slots of the sensors' own numbers.
        slot = px4_slot(imu, imu - 1)
    if slot is None or 0 != now.get(slot.sensor_id, 0) != then.get(slot.sensor_id, 0) != 0:
        return None
    before, after = (_correction(firmware, slot, values) for values in (now, then))
    R_b = mounting(firmware, slot, now)
    if before is None or after is None or R_b is None or not np.all(before.scale):
        return None
    rate = R_b @ (_gyro_offset(slot, now, then) - _gyro_offset(slot, then, now))
    return Recorrection(slot.effective(before), slot.effective(after), R_b, rate)


def _correction(firmware: str, slot: Slot, values: Values) -> Correction | None:
    # PX4 does not correct a sensor without an id.
    if firmware == PX4 and values.get(slot.sensor_id) == 0:
        return Correction(np.zeros(3), np.ones(3))
    return slot.correction(values)


def _gyro_offset(slot: Slot, values: Values, otherwise: Values) -> Vector:
    """Return the (3,) rad/s that PX4 subtracts; a value that was never reported has not changed."""
    if not slot.gyro_offset:
        return np.zeros(3)
    return np.array([values.get(name, otherwise.get(name, 0.0)) for name in slot.gyro_offset])


def join_segments(segments: Sequence[Segment], firmware: str, over_reboots: bool) -> Segment:
    """Return the longest run of `segments` that can be joined, as one under the parameters of its last one."""
    runs = [[segments[0]]]
    for segment in segments[1:]:
        separate = (segment.rebooted and not over_reboots) or not _can_join(runs[-1][-1], segment, firmware)
        if separate:
            runs.append([segment])
        else:
            runs[-1].append(segment)
    run = max(runs, key=lambda run: sum(map(len, run)))
    follows = segments.index(run[-1]) + 1
    cut = follows < len(segments) and not segments[follows].rebooted
    if len(run) == 1 and not (cut and firmware in LATE_US):
        return run[0]
    made = Segment(dict(run[-1].parameters))
    for k, segment in enumerate(run):
        skip_us = 0 if k == 0 or segment.rebooted else SETTLED_US
        next_cuts = cut if segment is run[-1] else not run[k + 1].rebooted
        _add(made, segment, firmware, skip_us, LATE_US.get(firmware, 0) if next_cuts else 0)
    return made


def _can_join(one: Segment, other: Segment, firmware: str) -> bool:
    imus = {stream.imu for segment in (one, other) for stream in segment.streams}
    if _altering(one.parameters) == _altering(other.parameters):
        return True
    return all(find_recorrection(firmware, imu, one.parameters, other.parameters) is not None for imu in imus)


def _add(made: Segment, segment: Segment, firmware: str, skip_us: int, drop_us: int) -> None:
    """Add a segment's readings, without those of its first and last times, as they would be under those of `made`."""
    same = _altering(segment.parameters) == _altering(made.parameters)
    for stream, buffer in segment.streams.items():
        times_us, numbers = buffer.rows()
        if not len(times_us):
            continue
        kept = (times_us >= times_us[0] + skip_us) & (times_us <= times_us[-1] - drop_us)
        numbers = numbers[kept]
        change = None if same else find_recorrection(firmware, stream.imu, segment.parameters, made.parameters)
        if change is not None:
            numbers[:, :3], numbers[:, 3:6] = change.acc(numbers[:, :3]), change.gyr(numbers[:, 3:6])
        made.of(stream).extend(times_us[kept], numbers)


def _altering(values: Values) -> dict[str, float]:
    return {name: value for name, value in values.items() if name.startswith(ALTERING)}


def _ids(values: Values) -> dict[str, float]:
    return {name: value for name, value in values.items() if name.endswith("_ID") and name.startswith(ACCELEROMETER)}
