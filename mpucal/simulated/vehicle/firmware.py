"""Base of the simulated firmwares: their parameters, which correct IMUs, and messages of the corrected IMUs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import UserDict
from collections.abc import Iterable, Sequence

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.imu import ACC_LSB_MPS2, GYRO_LSB_RAD_S, HIGHRES, MESSAGE_ID, RAW, SCALED
from ...mavlink.parameters.encoding import REAL32, Number, Parameter, as_float32
from ...mavlink.parameters.mounting import (
    CUSTOM_ANGLES,
    attitude_deg,
    euler_matrix,
    orientation_matrix,
    trim_of,
    trim_values,
)
from .imus import Imus
from .options import VehicleOptions


class ParameterStore(UserDict[str, Number]):
    """Values by name, with types; floats are kept as float32."""

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[str, int] = {}

    def add(self, name: str, value: Number, kind: int = REAL32) -> None:
        """Add a parameter of the firmware, with its default."""
        self._types[name] = kind
        self[name] = value

    def add_all(self, names: Iterable[str], value: float) -> None:
        """Add several floats with one default."""
        for name in names:
            self.add(name, value)

    def __setitem__(self, name: str, value: Number) -> None:
        super().__setitem__(name, as_float32(value) if self._types[name] == REAL32 else round(value))

    def type(self, name: str) -> int:
        """Return the MAV_PARAM_TYPE."""
        return self._types[name]

    def vector(self, names: Sequence[str]) -> Vector:
        """Return the values of several parameters."""
        return np.array([float(self[name]) for name in names])

    def set_vector(self, names: Sequence[str], values: Vector) -> None:
        """Set several parameters."""
        self.update(dict(zip(names, values.tolist(), strict=True)))


LSB = np.array([[ACC_LSB_MPS2], [GYRO_LSB_RAD_S]])
SCALED_IMUS = tuple(MESSAGE_ID[name] for name in SCALED)
RAW_IMU, HIGHRES_IMU = MESSAGE_ID[RAW], MESSAGE_ID[HIGHRES]
SYS_STATUS, ATTITUDE = 1, 30
# 4.7.0, a development version
VERSION = 0x04_07_00_00
COMMIT = b"5117ed00"
# An estimator learns nothing of a sensor that reads less than LEAST_MPS2, as without a scale.
LEARN_S, LARGEST_BIAS_MPS2, LEAST_MPS2 = 15.0, 0.4, 1.0
# param5 of MAV_CMD_PREFLIGHT_CALIBRATION, of both firmwares
LEVEL = 2


class Firmware(ABC):
    """Firmware of an autopilot.

    Attributes
    ----------
    autopilot : MAV_AUTOPILOT. tick_us : period of its loop. bytewise : see mavlink.parameters.encoding.
    store : its parameters.
    check_is_present : SYS_STATUS lists the pre-arm check as present.
    sends_on_request : it answers MAV_CMD_REQUEST_MESSAGE. streams : message ids and intervals [us] after a start.
    rotation : R_b (3, 3) of the board. mounting : the same with the level that turns the streams.
    corrected : (imus, 2, 3) specific force [m/s^2] and rate [rad/s] of the streams.
    """

    name: str

    autopilot: int
    tick_us: int
    bytewise: bool
    check_is_present = True
    sends_on_request = True
    streams: tuple[tuple[int, int], ...] = ()

    def __init__(self, options: VehicleOptions) -> None:
        self.options = options
        self.store = ParameterStore()
        self.rotation = self.mounting = mounted(options)
        self.corrected = np.zeros((options.imus, 2, 3))
        # Of the first accelerometer, by the attitude estimator [m/s^2].
        self.bias = np.zeros(3)
        self.temperature_c = 0.0
        self.armed = False
        # The next samples, under the corrections of the time at which they were drawn.
        self._ahead = np.empty((0, options.imus, 2, 3))
        self._at = 0

    def start(self) -> None:
        """Boot with the stored parameters; the estimator has learnt nothing yet."""
        self.bias = np.zeros(3)

    def sense(self, imus: Imus, ticks: int) -> None:
        """Take that many samples, one a tick."""
        while ticks > 0:
            if self._at == len(self._ahead):
                self._ahead, self._at = self.correct(imus.next()), 0
                self.temperature_c = imus.temperature_c
            n = min(ticks, len(self._ahead) - self._at)
            self._at += n
            ticks -= n
            self.process(self._ahead[self._at - n : self._at])

    @abstractmethod
    def correct(self, raw: Vector) -> Vector:
        """Return the next samples (n, imus, 2, 3), in the sensors' axes, corrected as in `corrected`."""

    def process(self, corrected: Vector) -> None:
        """Process samples (n, imus, 2, 3), one a tick."""
        self.corrected = corrected[-1]

    def message(self, message_id: int, t_us: int) -> Message | None:
        """Return the message, `t_us` after the boot; None for one that the firmware does not know."""
        if message_id in SCALED_IMUS[: self.options.imus]:
            return self.scaled_imu(SCALED_IMUS.index(message_id), t_us)
        if message_id == ATTITUDE:
            return self.attitude(t_us)
        return self.sys_status() if message_id == SYS_STATUS else None

    @abstractmethod
    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """Return MAV_RESULT of a request for a message each `interval_us`, and the interval that it gets."""

    @abstractmethod
    def set(self, wanted: Parameter) -> list[str] | int:
        """Set a parameter; return the names that the firmware echoes, none if it is silent, or MAV_PARAM_ERROR."""

    @abstractmethod
    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """Return offset and scale (3,) by which IMU `imu` is corrected now."""

    @abstractmethod
    def complaints(self) -> list[str]:
        """Return the reasons why it would not arm."""

    @abstractmethod
    def calibrate(self, how: float) -> bool:
        """Execute MAV_CMD_PREFLIGHT_CALIBRATION with this param5; return False if it is not supported."""

    def accepts(self, system: int) -> bool:
        """Return True if it accepts messages of a ground station with this id."""
        return True

    @property
    def trim_deg(self) -> Vector:
        """Trim (3,) in the parameters."""
        return trim_of(self.name, {name: float(value) for name, value in self.store.items()})

    def store_level(self, roll_pitch_deg: Vector) -> None:
        """Store roll and pitch of the trim."""
        self.store.update(trim_values(self.name, np.append(roll_pitch_deg, self.trim_deg[2])))

    @property
    def mean_force(self) -> Vector:
        """Mean of the first accelerometer (3,) over a tenth of a second."""
        return np.asarray(self._ahead[:, 0, 0].mean(axis=0)) if len(self._ahead) else self.corrected[0, 0]

    def attitude(self, t_us: int) -> Message:
        """Return ATTITUDE, by gravity as the estimator sees it."""
        roll, pitch = np.radians(attitude_deg(self.name, self.trim_deg, self.mean_force - self.bias)).tolist()
        rates: list[float] = self.corrected[0, 1].tolist()
        return dialect().MAVLink_attitude_message(t_us // 1000, roll, pitch, 0.0, *rates)

    def learn_offsets(self) -> list[str]:
        """Change the accelerometers' offsets by those that it learnt; return the names of the changed parameters."""
        return []

    def group(self, rate_hz: int) -> list[tuple[int, int]]:
        """Return message ids and intervals [us] of a REQUEST_DATA_STREAM of everything at `rate_hz`."""
        return []

    def milli(self, imu: int) -> list[int]:
        """Return the sample of an IMU in whole milli-g and mrad/s, truncated toward zero."""
        whole: list[int] = (self.corrected[imu] / LSB).astype(int).ravel().tolist()
        return whole

    def scaled_imu(self, imu: int, t_us: int, numbers: list[int] | None = None) -> Message:
        """Return SCALED_IMU, SCALED_IMU2 or SCALED_IMU3, with ten numbers other than the sample's if given."""
        m = dialect()
        kind = (m.MAVLink_scaled_imu_message, m.MAVLink_scaled_imu2_message, m.MAVLink_scaled_imu3_message)[imu]
        return kind(t_us // 1000, *(numbers or [*self.milli(imu), 0, 0, 0, round(self.temperature_c * 100)]))

    def highres_imu(self, t_us: int, bias: Vector, gyro_bias: Vector) -> Message:
        """Return HIGHRES_IMU of IMU 0, with `bias` (3,) [m/s^2] and `gyro_bias` (3,) [rad/s] subtracted."""
        acc, gyr = self.corrected[0]
        values = [*(acc - bias).tolist(), *(gyr - gyro_bias).tolist(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.temperature_c]
        return dialect().MAVLink_highres_imu_message(t_us, *values, 0x103F, 0)

    def version(self) -> Message:
        """Return AUTOPILOT_VERSION."""
        return dialect().MAVLink_autopilot_version_message(0, *[VERSION] * 3, 0, COMMIT, COMMIT, COMMIT, 0, 0, 0)

    def sys_status(self) -> Message:
        """Return SYS_STATUS, whose health holds the result of the pre-arm check."""
        accelerometer, check = dialect().MAV_SYS_STATUS_SENSOR_3D_ACCEL, dialect().MAV_SYS_STATUS_PREARM_CHECK
        sensors = accelerometer | (check if self.check_is_present else 0)
        health = accelerometer | (0 if self.complaints() else check)
        return dialect().MAVLink_sys_status_message(sensors, sensors, health, 100, 12000, -1, -1, 0, 0, 0, 0, 0, 0)


def learn_bias(bias: list[float], acc: list[float], share: float) -> list[float]:
    """Return the estimator's bias after a sample: it moves by `share` of what |acc| differs from gravity.

    Plain numbers take a tenth as long as arrays of three.
    """
    unbiased = [a - b for a, b in zip(acc, bias, strict=True)]
    gain = (1 - STANDARD_GRAVITY_MPS2 / max(math.hypot(*unbiased), LEAST_MPS2)) * share
    learnt = [b + f * gain for b, f in zip(bias, unbiased, strict=True)]
    return [min(max(b, -LARGEST_BIAS_MPS2), LARGEST_BIAS_MPS2) for b in learnt]


def mounted(options: VehicleOptions) -> Vector:
    """Return R_b (3, 3) of a board with a known orientation or custom angles."""
    if options.rotation in CUSTOM_ANGLES:
        return euler_matrix([options.parameters.get(name, 0.0) for name in CUSTOM_ANGLES[options.rotation]])
    rotation = orientation_matrix(options.rotation)
    return np.eye(3) if rotation is None else rotation
