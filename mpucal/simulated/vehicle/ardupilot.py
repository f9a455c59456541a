"""ArduPilot, as far as its accelerometers go: a 4.7 Copter."""

from __future__ import annotations

from itertools import chain

import numpy as np

from ...data import Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.parameters.encoding import REAL32, Parameter
from ...mavlink.parameters.mounting import CUSTOM_ANGLES
from .filter import LowPass
from .firmware import HIGHRES_IMU, RAW_IMU, SCALED_IMUS, SYS_STATUS, Firmware
from .imus import BLOCK
from .options import VehicleOptions
from .store import AXES, INT8, INT16, INT32

LOOP_HZ = 400
# 0.8 of the loop's rate is the most, and an interval has whole ms
SHORTEST_MS = 3
DEVICE_IDS = (2753028, 2753036, 2753044)
# what a SITL's parameters are, which is not the identity
OFFSET, SCALE = 0.001, 1.001
# by how much accelerometers may differ from the first, z counting half, and for how long they must not
INCONSISTENT_MPS2, AGREED_S = np.array([0.75, 0.75, 2.25]), 10
# of MAV_OPTIONS
ONLY_ITS_OWN = 1
# of MAV_CMD_PREFLIGHT_CALIBRATION
FORCE_SAVE = 76


def stem(imu: int) -> str:
    """What the names of IMU `imu`'s parameters begin with."""
    return "INS_ACC" if imu == 0 else f"INS_ACC{imu + 1}"


class ArduPilot(Firmware):
    """Corrects in the sensor's axes, turns to the vehicle's, then filters (AP_InertialSensor)."""

    autopilot = 3
    tick_us = 1_000_000 // LOOP_HZ
    folder = "/APM/"
    bytewise = False

    def __init__(self, options: VehicleOptions) -> None:
        super().__init__(options)
        self._saved_ids: list[int] = []
        store = self.store
        store.add("SYSID_THISMAV", options.system, INT16)
        store.add("MAV_OPTIONS", 0, INT16)
        store.add("MAV_GCS_SYSID", 255, INT16)
        store.add("AHRS_ORIENTATION", options.rotation, INT8)
        for name in chain(*CUSTOM_ANGLES.values()):
            store.add(name, 0.0)
        for axis in AXES:
            store.add(f"AHRS_TRIM_{axis}", 0.0)
        filter_hz = 10 if options.type == "rover" else 20
        store.add("INS_ACCEL_FILTER", filter_hz, INT16)
        store.add("INS_GYRO_FILTER", 4 if options.type == "rover" else 20, INT16)
        for imu in range(3):
            there = imu < options.imus
            store.add_vector(stem(imu) + "OFFS_", OFFSET if there else 0.0)
            store.add_vector(stem(imu) + "SCAL_", SCALE if there else 1.0)
            store.add(stem(imu) + "_ID", DEVICE_IDS[imu] if there else 0, INT32)
            store.add("INS_USE" + (str(imu + 1) if imu else ""), 1, INT8)

    def start(self) -> None:
        """Filters begin anew; each sensor shows its own id, whichever was saved."""
        super().start()
        if not self._saved_ids:
            self._saved_ids = [int(self.store[stem(imu) + "_ID"]) for imu in range(self.options.imus)]
        for imu in range(self.options.imus):
            self.store[stem(imu) + "_ID"] = DEVICE_IDS[imu]
        cutoffs = (float(self.store["INS_ACCEL_FILTER"]), float(self.store["INS_GYRO_FILTER"]))
        self._low_pass = LowPass(cutoffs, LOOP_HZ, BLOCK)
        self._ticks = 0
        self._agreed_since: int | None = None

    def correct(self, raw: Vector, again: int) -> Vector:
        """(raw - OFFS) * SCAL in the sensor's axes, R_b, low pass."""
        corrections = [self.correction(imu) for imu in range(self.options.imus)]
        offsets, scales = (np.array(part) for part in zip(*corrections, strict=True))
        in_sensor = raw.copy()
        in_sensor[:, :, 0] = (raw[:, :, 0] - offsets) * scales
        return self._low_pass(in_sensor @ self.rotation.T, again)

    def feel(self, corrected: Vector) -> None:
        """Compare the accelerometers once a second."""
        super().feel(corrected)
        self._ticks += len(corrected)
        since = self._ticks % LOOP_HZ
        if since < len(corrected):
            self._compare(corrected[-1 - since], self._ticks - since)

    def message(self, message_id: int, t_us: int) -> Message | None:
        """RAW_IMU is IMU 1, corrected and filtered like the rest."""
        if message_id == RAW_IMU:
            centi = round(self.temperature_c * 100)
            return dialect().MAVLink_raw_imu_message(t_us, *self.milli(0), 0, 0, 0, 0, centi)
        if message_id == HIGHRES_IMU and self.options.highres:
            return self.highres_imu(t_us, np.zeros(3), np.zeros(3))
        if message_id in SCALED_IMUS and SCALED_IMUS.index(message_id) < self.options.imus:
            return self.scaled_imu(SCALED_IMUS.index(message_id), t_us)
        if message_id in SCALED_IMUS[1:] and self.options.suffers("phantom"):
            number = SCALED_IMUS.index(message_id)
            m = dialect()
            kind = (m.MAVLink_scaled_imu2_message, m.MAVLink_scaled_imu3_message)[number - 1]
            return kind(t_us // 1000, *[0] * 10)
        return self.sys_status() if message_id == SYS_STATUS else None

    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """In whole ms; too short a one is denied, and what was before stays."""
        m = dialect()
        known = self.message(message_id, 0) is not None or message_id in SCALED_IMUS
        if not known or 0 < interval_us < SHORTEST_MS * 1000:
            return m.MAV_RESULT_DENIED, -1
        return m.MAV_RESULT_ACCEPTED, max(interval_us, 0) // 1000 * 1000

    def group(self, rate_hz: int) -> list[tuple[int, int]]:
        """All that a stream group holds; HIGHRES_IMU is in none."""
        interval_us = 1_000_000 // rate_hz if rate_hz else 0
        return [(message_id, interval_us) for message_id in (SYS_STATUS, RAW_IMU, *SCALED_IMUS[1 : self.options.imus])]

    def set(self, wanted: Parameter) -> list[Parameter | int]:
        """Echoes it, and with one axis of a vector all three; silent for an unknown name or NaN."""
        if wanted.name not in self.store or not np.isfinite(wanted.value) or wanted.name == self.options.refuse:
            return []
        self.store[wanted.name] = wanted.value
        echoed = [wanted.name]
        if wanted.name[:-1].endswith("_") and self.store.type(wanted.name) == REAL32:
            echoed = [wanted.name[:-1] + axis for axis in AXES]
        return [self.store.parameter(name) for name in echoed]

    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """As stored, at once."""
        return self.store.vector(stem(imu) + "OFFS_"), self.store.vector(stem(imu) + "SCAL_")

    def calibrate(self, how: float) -> bool:
        """Take the sensors that are there for the calibrated ones."""
        if how != FORCE_SAVE:
            return False
        self._saved_ids = list(DEVICE_IDS[: self.options.imus])
        return True

    def hears(self, system: int) -> bool:
        """Everybody, or with MAV_OPTIONS' bit 0 its own ground station alone."""
        return not int(self.store["MAV_OPTIONS"]) & ONLY_ITS_OWN or system == self.store["MAV_GCS_SYSID"]

    def complaints(self) -> list[str]:
        """Of AP_Arming's: every IMU calibrated, and all of one opinion for ten seconds."""
        for imu in range(self.options.imus):
            offset, scale = self.correction(imu)
            if self._saved_ids[imu] != DEVICE_IDS[imu] or not offset.any() or not scale.all():
                return ["PreArm: 3D Accel calibration needed"]
        since = self._compare(self.corrected, self._ticks)
        agree = len(self.corrected) == 1 or (since is not None and self._ticks - since >= AGREED_S * LOOP_HZ)
        return [] if agree else ["PreArm: Accels inconsistent"]

    def _compare(self, sample: Vector, tick: int) -> int | None:
        """Since which tick the accelerometers agree, with that one's (imus, 2, 3); None where they do not."""
        apart = np.linalg.norm((sample[:, 0] - sample[0, 0]) * [1.0, 1.0, 0.5], axis=1)
        if (apart > INCONSISTENT_MPS2[: len(apart)]).any():
            self._agreed_since = None
        elif self._agreed_since is None:
            self._agreed_since = tick
        return self._agreed_since
