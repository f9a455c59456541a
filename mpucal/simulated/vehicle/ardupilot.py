"""ArduPilot's treatment of accelerometers, as in Copter 4.7: correction, rotation and low pass."""

from __future__ import annotations

import math
from itertools import chain

import numpy as np

from ...data import Vector
from ...mavlink.dialect import Message, dialect
from ...mavlink.firmwares import ARDUPILOT, FILTERS
from ...mavlink.parameters.encoding import INT32, REAL32, Parameter
from ...mavlink.parameters.mounting import CUSTOM_ANGLES, ORIENTATION, tilt_deg
from ...mavlink.parameters.slots import AXES, all_slots
from ...vehicle.sink import SAVE_IDS
from .firmware import HIGHRES_IMU, LEARN_S, LEVEL, RAW_IMU, SCALED_IMUS, SYS_STATUS, Firmware, learn_bias
from .options import VehicleOptions

Three = tuple[float, float, float]


class LowPass:
    """Butterworth filters of order 2, one for each row of a value's last axis but one.

    Parameters
    ----------
    cutoffs_hz : (k,) for values (..., k, 3); 0: no filter.
    """

    def __init__(self, cutoffs_hz: tuple[float, ...], rate_hz: float) -> None:
        made = [butterworth(cutoff, rate_hz) if cutoff > 0 else ((1.0, 0.0, 0.0),) * 2 for cutoff in cutoffs_hz]
        # Each is (3, k, 1).
        self._b, self._a = np.array(made).transpose(1, 2, 0)[..., None]
        self._past: list[Vector] = []

    def __call__(self, values: Vector) -> Vector:
        """Return the filtered `values` (n, ..., k, 3); the filter starts in the steady state of the first one."""
        states = self._past or [values[0] / self._a.sum(0)] * 2
        for value in values:
            states.append(value - self._a[1] * states[-1] - self._a[2] * states[-2])
        self._past = states[-2:]
        held = np.array(states)
        return np.asarray(self._b[0] * held[2:] + self._b[1] * held[1:-1] + self._b[2] * held[:-2])


def butterworth(cutoff_hz: float, rate_hz: float) -> tuple[Three, Three]:
    """Return numerator and denominator as ArduPilot computes them (DigitalBiquadFilter).

    This is the bilinear transform of 1 / (s^2 + sqrt(2) s + 1) with a warped frequency; scipy.signal, which has it,
    takes a second to load.
    """
    w = math.tan(math.pi * cutoff_hz / rate_hz)
    whole = 1.0 + math.sqrt(2.0) * w + w * w
    share = w * w / whole
    return (share, 2.0 * share, share), (1.0, 2.0 * (w * w - 1.0) / whole, (1.0 - math.sqrt(2.0) * w + w * w) / whole)


LOOP_HZ = 400
DEVICE_IDS = (2753028, 2753036, 2753044)
SLOTS = all_slots(ARDUPILOT)
# Greatest difference of the accelerometers from the first, where z counts half.
INCONSISTENT_MPS2 = np.array([0.75, 0.75, 2.25])


class ArduPilot(Firmware):
    """Firmware that corrects in the sensor's axes, turns to the vehicle's, then filters (AP_InertialSensor)."""

    name = ARDUPILOT
    autopilot = 3
    tick_us = 1_000_000 // LOOP_HZ
    bytewise = False

    def __init__(self, options: VehicleOptions) -> None:
        super().__init__(options)
        self._saved_ids: list[int] = []
        store, m = self.store, dialect()
        int8, int16 = m.MAV_PARAM_TYPE_INT8, m.MAV_PARAM_TYPE_INT16
        store.add("SYSID_THISMAV", options.system, int16)
        store.add("MAV_OPTIONS", 0, int16)
        store.add("MAV_GCS_SYSID", 255, int16)
        store.add(ORIENTATION, options.rotation, int8)
        store.add_all(chain(*CUSTOM_ANGLES.values(), (f"AHRS_TRIM_{axis}" for axis in AXES)), 0.0)
        for name, cutoff_hz in zip(FILTERS, (10, 4) if options.type == "rover" else (20, 20), strict=True):
            store.add(name, cutoff_hz, int16)
        for imu, slot in enumerate(SLOTS):
            exists = imu < options.imus
            # Defaults of a SITL, which are not the identity.
            store.add_all(slot.offset, 0.001 if exists else 0.0)
            store.add_all(slot.scale, 1.001 if exists else 1.0)
            store.add(slot.sensor_id, DEVICE_IDS[imu] if exists else 0, INT32)
            store.add("INS_USE" + (str(imu + 1) if imu else ""), 1, int8)

    def start(self) -> None:
        """Restart the filters; each sensor shows its own id, whichever was saved."""
        super().start()
        slots = SLOTS[: self.options.imus]
        if not self._saved_ids:
            self._saved_ids = [int(self.store[slot.sensor_id]) for slot in slots]
        for imu, slot in enumerate(slots):
            self.store[slot.sensor_id] = DEVICE_IDS[imu]
        self._low_pass = LowPass(tuple(float(self.store[name]) for name in FILTERS), LOOP_HZ)
        self._ticks = 0
        self._agreed_since: int | None = None

    def correct(self, raw: Vector) -> Vector:
        """Return (raw - OFFS) * SCAL in the sensor's axes, turned by R_b and filtered."""
        corrections = [self.correction(imu) for imu in range(self.options.imus)]
        offsets, scales = (np.array(part) for part in zip(*corrections, strict=True))
        in_sensor = raw.copy()
        in_sensor[:, :, 0] = (raw[:, :, 0] - offsets) * scales
        return self._low_pass(in_sensor @ self.rotation.T)

    def process(self, corrected: Vector) -> None:
        """Compare the accelerometers and learn the first one's bias, once a second."""
        super().process(corrected)
        self._ticks += len(corrected)
        since = self._ticks % LOOP_HZ
        if since < len(corrected):
            self._compare(corrected[-1 - since], self._ticks - since)
            acc: list[float] = corrected[-1 - since, 0, 0].tolist()
            self.bias = np.array(learn_bias(self.bias.tolist(), acc, 1 / LEARN_S))

    def message(self, message_id: int, t_us: int) -> Message | None:
        """Return a message; RAW_IMU is IMU 1, corrected and filtered like the others."""
        if message_id == RAW_IMU:
            centi = round(self.temperature_c * 100)
            return dialect().MAVLink_raw_imu_message(t_us, *self.milli(0), 0, 0, 0, 0, centi)
        if message_id == HIGHRES_IMU and self.options.highres:
            message = self.highres_imu(t_us, np.zeros(3), np.zeros(3))
            message.temperature = 41.0  # the barometer's
            return message
        if message_id in SCALED_IMUS[self.options.imus :] and "phantom" in (fault.name for fault in self.options.fault):
            return self.scaled_imu(SCALED_IMUS.index(message_id), t_us, [0] * 10)
        return super().message(message_id, t_us)

    def interval(self, message_id: int, interval_us: int) -> tuple[int, int]:
        """Accept an interval in whole ms; deny a shorter one than it can send, which changes nothing."""
        m = dialect()
        known = self.message(message_id, 0) is not None or message_id in SCALED_IMUS
        # 0.8 of the loop's rate at most, in whole ms
        if not known or 0 < interval_us < 3000:
            return m.MAV_RESULT_DENIED, -1
        return m.MAV_RESULT_ACCEPTED, max(interval_us, 0) // 1000 * 1000

    def group(self, rate_hz: int) -> list[tuple[int, int]]:
        """Return the messages of stream groups; HIGHRES_IMU is in none."""
        interval_us = 1_000_000 // rate_hz if rate_hz else 0
        return [(message_id, interval_us) for message_id in (SYS_STATUS, RAW_IMU, *SCALED_IMUS[1 : self.options.imus])]

    def set(self, wanted: Parameter) -> list[str] | int:
        """Echo the parameter, and with one axis of a vector all three; ignore an unknown name or NaN."""
        if wanted.name not in self.store or not np.isfinite(wanted.value) or wanted.name == self.options.refuse:
            return []
        self.store[wanted.name] = wanted.value
        is_vector = wanted.name[:-1].endswith("_") and self.store.type(wanted.name) == REAL32
        return [wanted.name[:-1] + axis for axis in AXES] if is_vector else [wanted.name]

    def correction(self, imu: int) -> tuple[Vector, Vector]:
        """Return the stored correction, in use from the next samples on."""
        return self.store.vector(SLOTS[imu].offset), self.store.vector(SLOTS[imu].scale)

    def calibrate(self, how: float) -> bool:
        """Store the level, or the ids of the present sensors as those of the calibrated ones."""
        if how == LEVEL:
            self.store_level(tilt_deg(self.mean_force))
            return True
        if how != SAVE_IDS:
            return False
        self._saved_ids = list(DEVICE_IDS[: self.options.imus])
        return True

    def accepts(self, system: int) -> bool:
        """Accept every station, or with MAV_OPTIONS' bit 0 the vehicle's own ground station alone."""
        return not int(self.store["MAV_OPTIONS"]) & 1 or system == self.store["MAV_GCS_SYSID"]

    def complaints(self) -> list[str]:
        """Return AP_Arming's complaints: every IMU must be calibrated, and all must agree for ten seconds."""
        for imu in range(self.options.imus):
            offset, scale = self.correction(imu)
            if self._saved_ids[imu] != DEVICE_IDS[imu] or not offset.any() or not scale.all():
                return ["PreArm: 3D Accel calibration needed"]
        since = self._compare(self.corrected, self._ticks)
        agree = len(self.corrected) == 1 or (since is not None and self._ticks - since >= 10 * LOOP_HZ)
        return [] if agree else ["PreArm: Accels inconsistent"]

    def _compare(self, sample: Vector, tick: int) -> int | None:
        """Return the tick since which the accelerometers agree, up to the sample (imus, 2, 3) of `tick`, or None."""
        apart = np.linalg.norm((sample[:, 0] - sample[0, 0]) * [1.0, 1.0, 0.5], axis=1)
        if (apart > INCONSISTENT_MPS2[: len(apart)]).any():
            self._agreed_since = None
        elif self._agreed_since is None:
            self._agreed_since = tick
        return self._agreed_since
