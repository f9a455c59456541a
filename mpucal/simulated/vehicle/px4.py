"""PX4's treatment of accelerometers, as in 1.17."""

from __future__ import annotations

import math

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.firmwares import EKF2_IMU_CTRL, LEARN_ACCELEROMETER, LEARN_GYROSCOPE, PX4
from ...mavlink.parameters.encoding import INT32, Parameter
from ...mavlink.parameters.mounting import BOARD_ANGLES, BOARD_ROTATION, euler_matrix, tilt_deg
from ...mavlink.parameters.slots import PX4_LIMITS, Slot, all_slots
from ...mavlink.px4_preparation import AUTOCAL, QUICK
from .firmware import (
    ATTITUDE,
    HIGHRES_IMU,
    LEARN_S,
    LEVEL,
    RAW_IMU,
    SCALED_IMUS,
    SYS_STATUS,
    Firmware,
    learn_bias,
)
from .options import VehicleOptions

LOOP_HZ = 250
SLOTS = all_slots(PX4)
DEVICE_IDS = (1310988, 1310996, 1311004)
# MAV_PARAM_ERROR, of which pymavlink lacks the end
TYPE_MISMATCH = 7
# A lower rate is taken for a bias.
STILL_RAD_S = 0.05


class Px4(Firmware):
    """Firmware that corrects in the sensor's axes and turns to the vehicle's; HIGHRES_IMU lacks the EKF's biases."""

    name = PX4
    autopilot = 12
    tick_us = 1_000_000 // LOOP_HZ
    bytewise = True
    check_is_present = sends_on_request = False
    streams = ((HIGHRES_IMU, 20_000), (SYS_STATUS, 1_000_000))

    def __init__(self, options: VehicleOptions) -> None:
        super().__init__(options)
        store = self.store
        store.add("MAV_SYS_ID", options.system, INT32)
        store.add(BOARD_ROTATION, options.rotation, INT32)
        store.add_all(BOARD_ANGLES, 0.0)
        store.add(EKF2_IMU_CTRL, 0b111, INT32)
        store.add(AUTOCAL, 1, INT32)
        for number, slot in enumerate(SLOTS):
            exists = number < options.imus
            store.add(slot.sensor_id, DEVICE_IDS[number] if exists else 0, INT32)
            store.add(str(slot.priority), 50 if exists else -1, INT32)
            store.add(str(slot.rotation), -1, INT32)
            store.add_all(slot.offset, 0.0)
            store.add_all(slot.scale, 1.0)
            store.add_all(slot.gyro_offset, 0.0)

    def start(self) -> None:
        """Start from the identity, and take over the stored corrections that differ enough from it."""
        super().start()
        self._offset, self._scale = np.zeros((self.options.imus, 3)), np.ones((self.options.imus, 3))
        self._gyro_bias = np.zeros(3)
        self._take_over()

    def _take_over(self) -> None:
        # The streams are turned by the level, too.
        self.mounting = euler_matrix(self.store.vector(BOARD_ANGLES).tolist()) @ self.rotation
        self._rates = np.array([self.store.vector(SLOTS[imu].gyro_offset) for imu in range(self.options.imus)])
        for imu in range(self.options.imus):
            slot = self._slot(imu)
            if slot is None:
                continue
            for running, names in ((self._offset, slot.offset), (self._scale, slot.scale)):
                stored = self.store.vector(names)
                if np.linalg.norm(stored - running[imu]) > PX4_LIMITS.unnoticed:
                    running[imu] = stored

    def _slot(self, imu: int) -> Slot | None:
        """Return the slot that names the sensor by its id."""
        return next((slot for slot in SLOTS if self.store[slot.sensor_id] == DEVICE_IDS[imu]), None)

    def correct(self, raw: Vector) -> Vector:
        """Return R_b ((raw - OFF) * SCALE), and of rates R_b (raw - OFF)."""
        in_sensor = np.stack(((raw[:, :, 0] - self._offset) * self._scale, raw[:, :, 1] - self._rates), axis=2)
        return np.asarray(in_sensor @ self.mounting.T)

    def process(self, corrected: Vector) -> None:
        """Estimate the EKF's biases of IMU 1."""
        super().process(corrected)
        control, share = int(self.store[EKF2_IMU_CTRL]), self.tick_us * 1e-6 / LEARN_S
        bias, gyro_bias = self.bias.tolist(), self._gyro_bias.tolist()
        for acc, rate in corrected[:, 0].tolist():
            if control & LEARN_GYROSCOPE and math.hypot(*rate) < STILL_RAD_S:
                gyro_bias = [b + (r - b) * share for b, r in zip(gyro_bias, rate, strict=True)]
            if control & LEARN_ACCELEROMETER:
                bias = learn_bias(bias, acc, share)
        self.bias, self._gyro_bias = np.array(bias), np.array(gyro_bias)

    def message(self, message_id: int, t_us: int) -> Message | None:
        """Return a message; there is no RAW_IMU."""
        if message_id == HIGHRES_IMU:
            return self.highres_imu(t_us, self.bias, self._gyro_bias)
        return super().message(message_id, t_us)

    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """Accept any stream that it knows, at most as fast as it can send it."""
        m = dialect()
        if message_id == RAW_IMU or message_id not in (HIGHRES_IMU, SYS_STATUS, ATTITUDE, *SCALED_IMUS):
            return m.MAV_RESULT_FAILED, -1
        if interval_us <= 0:
            return m.MAV_RESULT_ACCEPTED, 0
        # A sample that comes before its interval is over is omitted: every one is sent, or every second.
        slower = interval_us > self.tick_us
        return m.MAV_RESULT_ACCEPTED, max(interval_us, 2 * self.tick_us) if slower else self.tick_us

    def set(self, wanted: Parameter) -> list[str] | int:
        """Echo the parameter; an unknown name or another type is an error."""
        if wanted.name not in self.store:
            return int(dialect().MAV_PARAM_ERROR_DOES_NOT_EXIST)
        if wanted.name == self.options.refuse:
            return int(dialect().MAV_PARAM_ERROR_PERMISSION_DENIED)
        if wanted.type != self.store.type(wanted.name):
            return TYPE_MISMATCH
        self.store[wanted.name] = wanted.value
        self._take_over()
        return [wanted.name]

    def learn_offsets(self) -> list[str]:
        """Add the estimator's biases of IMU 1 to its offsets (SENS_IMU_AUTOCAL), in a slot that names it."""
        if not self.store[AUTOCAL]:
            return []
        slot, gyro_offset = self._slot(0) or SLOTS[0], SLOTS[0].gyro_offset
        self.store[slot.sensor_id] = DEVICE_IDS[0]
        self.store.set_vector(slot.offset, self._offset[0] + self.mounting.T @ self.bias)
        self.store.set_vector(gyro_offset, self.store.vector(gyro_offset) + self.mounting.T @ self._gyro_bias)
        self._gyro_bias = np.zeros(3)
        self._take_over()
        return [slot.sensor_id, *slot.offset, *gyro_offset]

    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """Return the correction that was taken over."""
        return self._offset[imu], self._scale[imu]

    def calibrate(self, how: float) -> bool:
        """Store the level, or each sensor's id and the offset that makes it level: `commander`'s quick calibration."""
        if how == LEVEL:
            at_rest = euler_matrix(self.trim_deg.tolist()).T @ (self.mean_force - self.bias)
            self.store_level(tilt_deg(at_rest))
            self._take_over()
            return True
        if how != QUICK:
            return False
        for imu in range(self.options.imus):
            slot = self._slot(imu) or SLOTS[imu]
            level = self.mounting.T @ (self.corrected[imu, 0] - [0.0, 0.0, -STANDARD_GRAVITY_MPS2]) + self._offset[imu]
            self.store[slot.sensor_id] = DEVICE_IDS[imu]
            self.store.set_vector(slot.offset, level)
        self._take_over()
        return True

    def complaints(self) -> list[str]:
        """Return a complaint for each sensor without a slot."""
        missing = [imu for imu in range(self.options.imus) if self._slot(imu) is None]
        return [f"Preflight Fail: Accel {imu} uncalibrated" for imu in missing]
