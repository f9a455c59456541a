"""PX4, as far as its accelerometers go: 1.17."""

from __future__ import annotations

import math

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.parameters.encoding import Parameter
from .firmware import HIGHRES_IMU, RAW_IMU, SCALED_IMUS, SYS_STATUS, Firmware
from .options import VehicleOptions
from .store import AXES, INT32

LOOP_HZ = 250
SHORTEST_US = 8000
SLOTS = 4
DEVICE_IDS = (1310988, 1310996, 1311004)
UNNOTICED = 0.01  # a change whose norm is less, in m/s^2 or of the scale, is not taken over
# MAV_PARAM_ERROR
DOES_NOT_EXIST, PERMISSION_DENIED, TYPE_MISMATCH = 1, 3, 7
LEARN_S, LARGEST_BIAS_MPS2 = 15.0, 0.4
LEARN_GYROSCOPE, LEARN_ACCELEROMETER = 1, 2
# below which the rate is taken for a bias
STILL_RAD_S = 0.05
ALL_OF_THEM = 7
# of MAV_CMD_PREFLIGHT_CALIBRATION
QUICK = 4


class Px4(Firmware):
    """Corrects in the sensor's axes and turns to the vehicle's; the EKF's bias is taken from HIGHRES_IMU."""

    autopilot = 12
    tick_us = 1_000_000 // LOOP_HZ
    folder = "/fs/microsd/"
    bytewise = True
    check_is_present = sends_on_request = False
    streams = ((HIGHRES_IMU, 20_000), (SYS_STATUS, 1_000_000))

    def __init__(self, options: VehicleOptions) -> None:
        super().__init__(options)
        store = self.store
        store.add("MAV_SYS_ID", options.system, INT32)
        store.add("SENS_BOARD_ROT", options.rotation, INT32)
        store.add_vector("SENS_BOARD_", 0.0, "_OFF")
        store.add("EKF2_IMU_CTRL", ALL_OF_THEM, INT32)
        store.add("SENS_IMU_AUTOCAL", 1, INT32)
        for slot in range(SLOTS):
            there = slot < options.imus
            store.add(f"CAL_ACC{slot}_ID", DEVICE_IDS[slot] if there else 0, INT32)
            store.add(f"CAL_ACC{slot}_PRIO", 50 if there else -1, INT32)
            store.add(f"CAL_ACC{slot}_ROT", -1, INT32)
            store.add_vector(f"CAL_ACC{slot}_", 0.0, "OFF")
            store.add_vector(f"CAL_ACC{slot}_", 1.0, "SCALE")
            store.add_vector(f"CAL_GYRO{slot}_", 0.0, "OFF")

    def start(self) -> None:
        """From the identity, what is stored is taken over where it differs enough."""
        super().start()
        self._offset, self._scale = np.zeros((self.options.imus, 3)), np.ones((self.options.imus, 3))
        self._bias, self._gyro_bias = np.zeros(3), np.zeros(3)
        self._take_over()

    def _take_over(self) -> None:
        self._rates = np.array([self.store.vector(f"CAL_GYRO{imu}_", "OFF") for imu in range(self.options.imus)])
        for imu in range(self.options.imus):
            slot = self._slot(imu)
            if slot is None:
                continue
            for running, tail in ((self._offset, "OFF"), (self._scale, "SCALE")):
                stored = self.store.vector(f"CAL_ACC{slot}_", tail)
                if np.linalg.norm(stored - running[imu]) > UNNOTICED:
                    running[imu] = stored

    def _slot(self, imu: int) -> int | None:
        """Where the sensor with this id keeps its correction."""
        ids = [self.store[f"CAL_ACC{slot}_ID"] for slot in range(SLOTS)]
        return ids.index(DEVICE_IDS[imu]) if DEVICE_IDS[imu] in ids else None

    def correct(self, raw: Vector, again: int) -> Vector:
        """R_b ((raw - OFF) * SCALE), and of rates R_b (raw - OFF)."""
        in_sensor = np.stack(((raw[:, :, 0] - self._offset) * self._scale, raw[:, :, 1] - self._rates), axis=2)
        return np.asarray(in_sensor @ self.rotation.T)

    def feel(self, corrected: Vector) -> None:
        """What the EKF makes of IMU 1; plain numbers take a tenth as long as arrays of three."""
        super().feel(corrected)
        control, share = int(self.store["EKF2_IMU_CTRL"]), self.tick_us * 1e-6 / LEARN_S
        bias, gyro_bias = self._bias.tolist(), self._gyro_bias.tolist()
        for acc, rate in corrected[:, 0].tolist():
            if control & LEARN_GYROSCOPE and math.hypot(*rate) < STILL_RAD_S:
                gyro_bias = [b + (r - b) * share for b, r in zip(gyro_bias, rate, strict=True)]
            if control & LEARN_ACCELEROMETER:
                felt = [a - b for a, b in zip(acc, bias, strict=True)]
                gain = (1 - STANDARD_GRAVITY_MPS2 / math.hypot(*felt)) * share
                learnt = [b + f * gain for b, f in zip(bias, felt, strict=True)]
                bias = [min(max(b, -LARGEST_BIAS_MPS2), LARGEST_BIAS_MPS2) for b in learnt]
        self._bias, self._gyro_bias = np.array(bias), np.array(gyro_bias)

    def message(self, message_id: int, t_us: int) -> Message | None:
        """No RAW_IMU, ever."""
        if message_id == HIGHRES_IMU:
            return self.highres_imu(t_us, self._bias, self._gyro_bias)
        if message_id in SCALED_IMUS and SCALED_IMUS.index(message_id) < self.options.imus:
            return self.scaled_imu(SCALED_IMUS.index(message_id), t_us)
        return self.sys_status() if message_id == SYS_STATUS else None

    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """Acknowledged for any stream that it knows; no faster than it can."""
        m = dialect()
        if message_id == RAW_IMU or message_id not in (HIGHRES_IMU, SYS_STATUS, *SCALED_IMUS):
            return m.MAV_RESULT_FAILED, -1
        if interval_us <= 0:
            return m.MAV_RESULT_ACCEPTED, 0
        # a sample that comes before its interval is over is left out: every one, or every second
        return m.MAV_RESULT_ACCEPTED, self.tick_us if interval_us <= self.tick_us else max(interval_us, SHORTEST_US)

    def set(self, wanted: Parameter) -> list[Parameter | int]:
        """Echoes it; an unknown name or another type is an error."""
        if wanted.name not in self.store:
            return [DOES_NOT_EXIST]
        if wanted.name == self.options.refuse:
            return [PERMISSION_DENIED]
        if wanted.type != self.store.type(wanted.name):
            return [TYPE_MISMATCH]
        self.store[wanted.name] = wanted.value
        self._take_over()
        return [self.store.parameter(wanted.name)]

    def learn_offsets(self) -> list[str]:
        """SENS_IMU_AUTOCAL: the estimator's biases of IMU 1 join its offsets, in a slot that names it."""
        if not self.store["SENS_IMU_AUTOCAL"]:
            return []
        slot = self._slot(0) or 0
        self.store[f"CAL_ACC{slot}_ID"] = DEVICE_IDS[0]
        for axis, value in zip(AXES, self._offset[0] + self.rotation.T @ self._bias, strict=True):
            self.store[f"CAL_ACC{slot}_{axis}OFF"] = float(value)
        rate = self.store.vector("CAL_GYRO0_", "OFF") + self.rotation.T @ self._gyro_bias
        for axis, value in zip(AXES, rate, strict=True):
            self.store[f"CAL_GYRO0_{axis}OFF"] = float(value)
        self._gyro_bias = np.zeros(3)
        self._take_over()
        told = [f"CAL_ACC{slot}_{axis}OFF" for axis in AXES] + [f"CAL_GYRO0_{axis}OFF" for axis in AXES]
        return [f"CAL_ACC{slot}_ID", *told]

    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """As it was taken over."""
        return self._offset[imu], self._scale[imu]

    def calibrate(self, how: float) -> bool:
        """Name each sensor, with the offset that makes it level: the quick calibration of `commander`."""
        if how != QUICK:
            return False
        for imu in range(self.options.imus):
            slot = self._slot(imu)
            slot = imu if slot is None else slot
            felt = self.corrected[imu, 0]
            level = self.rotation.T @ (felt - [0.0, 0.0, -STANDARD_GRAVITY_MPS2]) + self._offset[imu]
            self.store[f"CAL_ACC{slot}_ID"] = DEVICE_IDS[imu]
            for axis, value in zip(AXES, level, strict=True):
                self.store[f"CAL_ACC{slot}_{axis}OFF"] = float(value)
        self._take_over()
        return True

    def complaints(self) -> list[str]:
        """Every sensor needs a slot."""
        missing = [imu for imu in range(self.options.imus) if self._slot(imu) is None]
        return [f"Preflight Fail: Accel {imu} uncalibrated" for imu in missing]
