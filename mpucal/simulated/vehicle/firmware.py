"""What ArduPilot and PX4 both have: parameters that correct IMUs, and messages made of them."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.parameters.encoding import Parameter
from ...mavlink.parameters.mounting import CUSTOM_ANGLES, euler_matrix, orientation_matrix
from .imus import Imus
from .options import VehicleOptions
from .store import ParameterStore

# milli-g and mrad/s
WHOLE = np.array([[STANDARD_GRAVITY_MPS2 / 1000], [1e-3]])
# SCALED_IMU, SCALED_IMU2, SCALED_IMU3
SCALED_IMUS = (26, 116, 129)
SYS_STATUS, RAW_IMU, HIGHRES_IMU = 1, 27, 105
PREARM_CHECK = 0x10000000
ACCELEROMETER = 2


class Firmware(ABC):
    """An autopilot's firmware.

    Attributes
    ----------
    autopilot : MAV_AUTOPILOT. tick_us : how often it runs. bytewise : how its integers travel.
    folder : of its card. store : its parameters.
    check_is_present : SYS_STATUS names the check before arming among what is there.
    sends_on_request : MAV_CMD_REQUEST_MESSAGE brings it; else it comes in its stream alone.
    corrected : (imus, 2, 3) specific force [m/s^2] and rate [rad/s] in the vehicle's axes.
    """

    autopilot: int
    tick_us: int
    bytewise: bool
    folder: str
    check_is_present = True
    sends_on_request = True
    streams: tuple[tuple[int, int], ...] = ()

    def __init__(self, options: VehicleOptions) -> None:
        self.options = options
        self.store = ParameterStore()
        self.rotation = mounted(options)
        self.corrected = np.zeros((options.imus, 2, 3))
        self.temperature_c = 0.0
        self.armed = False
        # samples that come next, and what they are by the corrections that are in use now
        self._raw = self._ahead = np.empty((0, options.imus, 2, 3))
        self._at = 0
        self._taken = -1

    def start(self) -> None:
        """Boot: take what is stored."""
        self._taken = -1

    def sense(self, imus: Imus, ticks: int) -> None:
        """Take so many of the samples that come, one a tick."""
        while ticks > 0:
            again = len(self._raw) - self._at
            if not again:
                self._raw, self._at = imus.next(), 0
                self.temperature_c = imus.temperature_c
            if not again or self._taken != self.store.version:
                self._taken = self.store.version
                self._raw, self._at = self._raw[self._at :], 0
                self._ahead = self.correct(self._raw, again)
            n = min(ticks, len(self._raw) - self._at)
            self._at += n
            ticks -= n
            self.feel(self._ahead[self._at - n : self._at])

    @abstractmethod
    def correct(self, raw: Vector, again: int) -> Vector:
        """Samples (n, imus, 2, 3) that follow, from the sensors' axes into `corrected`.

        Parameters
        ----------
        again : so many of them were corrected before, as the corrections were then.
        """

    def feel(self, corrected: Vector) -> None:
        """Go on by samples (n, imus, 2, 3), one a tick."""
        self.corrected = corrected[-1]

    @abstractmethod
    def message(self, message_id: int, t_us: int) -> Message | None:
        """The message, `t_us` after the boot; None for one that it does not know."""

    @abstractmethod
    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """Asked for a message each `interval_us`: MAV_RESULT, and the interval that it will be."""

    @abstractmethod
    def set(self, wanted: Parameter) -> list[Parameter | int]:
        """Set a parameter: the echoes, or the MAV_PARAM_ERROR; nothing where it says nothing."""

    @abstractmethod
    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """Offset and scale (3,) that IMU `imu` is corrected by now."""

    @abstractmethod
    def complaints(self) -> list[str]:
        """Why it would not arm."""

    @abstractmethod
    def calibrate(self, how: float) -> bool:
        """MAV_CMD_PREFLIGHT_CALIBRATION with this param5; whether it does that."""

    def hears(self, system: int) -> bool:
        """Whether it takes messages of a ground station with this id."""
        return True

    def learn_offsets(self) -> list[str]:
        """Change the accelerometers' offsets by what it learnt meanwhile; the names of what was changed."""
        return []

    def group(self, rate_hz: int) -> list[tuple[int, int]]:
        """What REQUEST_DATA_STREAM of everything at `rate_hz` sets: message, interval [us]."""
        return []

    def milli(self, imu: int) -> list[int]:
        """Its sample in whole milli-g and mrad/s, truncated toward zero."""
        whole: list[int] = (self.corrected[imu] / WHOLE).astype(int).ravel().tolist()
        return whole

    def scaled_imu(self, imu: int, t_us: int) -> Message:
        """SCALED_IMU, SCALED_IMU2 or SCALED_IMU3."""
        m = dialect()
        kind = (m.MAVLink_scaled_imu_message, m.MAVLink_scaled_imu2_message, m.MAVLink_scaled_imu3_message)[imu]
        return kind(t_us // 1000, *self.milli(imu), 0, 0, 0, round(self.temperature_c * 100))

    def highres_imu(self, t_us: int, bias: Vector, gyro_bias: Vector) -> Message:
        """HIGHRES_IMU of IMU 0, with `bias` (3,) [m/s^2] and `gyro_bias` (3,) [rad/s] subtracted."""
        acc, gyr = self.corrected[0]
        values = [*(acc - bias).tolist(), *(gyr - gyro_bias).tolist(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.temperature_c]
        return dialect().MAVLink_highres_imu_message(t_us, *values, 0x103F, 0)

    def sys_status(self) -> Message:
        """SYS_STATUS, whose health says whether it would arm."""
        sensors = ACCELEROMETER | (PREARM_CHECK if self.check_is_present else 0)
        health = ACCELEROMETER | (0 if self.complaints() else PREARM_CHECK)
        return dialect().MAVLink_sys_status_message(sensors, sensors, health, 100, 12000, -1, -1, 0, 0, 0, 0, 0, 0)


def mounted(options: VehicleOptions) -> Vector:
    """R_b (3, 3) of a board that is turned by a known orientation, or by angles of its own."""
    if options.rotation in CUSTOM_ANGLES:
        degrees = [options.parameters.get(name, 0.0) for name in CUSTOM_ANGLES[options.rotation]]
        return euler_matrix(degrees)
    rotation = orientation_matrix(options.rotation)
    return np.eye(3) if rotation is None else rotation
