"""Body of a vehicle in the simulated hand, for an autopilot's own simulator, which reads its sensors."""

import json
import select
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.parameters.slots import ARDUPILOT_IMUS, AXES, Correction
from mpucal.mavlink.texts import ReceivedPrompt
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import Motion
from mpucal.simulated.rotation import conjugate, product, up_in_board
from mpucal.simulated.vehicle.imus import FROM_HAND, to_hand_axes

LOOPBACK = "127.0.0.1"
TURNED_RAD_S = 0.1
# header of a message of ArduPilot's SITL for each step: magic number, steps a second, number of the step
HEAD, MAGIC = struct.Struct("<HHI"), (18458, 29569)
BLOCK = 20
KINDS_OF_ERROR = ("BIAS", "SCAL")
SITL_ERRORS = (
    "SIM_IMU_COUNT",
    *(f"SIM_ACC{imu}_{kind}_{a}" for imu in range(1, ARDUPILOT_IMUS + 1) for kind in KINDS_OF_ERROR for a in AXES),
)

# PX4 takes samples of its IMUs at this rate.
HIL_HZ, HIL_BLOCK, HIL_IMUS = 250, 5, 2
MOST_LATE_S = 0.1
MOST_BIAS_MPS2, MOST_SCALE = 0.5, 0.03
GYRO_BIAS_RAD_S = 1e-3
NOISE_MPS2, NOISE_RAD_S = 0.03, 1e-3
# PX4 truncates IMU 1 to whole counts of 16 bits, as of a sensor with these ranges.
ACC_LSB_MPS2, GYRO_LSB_RAD_S = STANDARD_GRAVITY_MPS2 / 2048, float(np.radians(2000)) / 32768
# magnetic field [gauss], north, east and down, and its share of noise; of a barometer [hPa]
FIELD, MAG_NOISE, PRESSURE_HPA, BARO_NOISE_HPA = np.array([0.21, 0.0, 0.43]), 1e-3, 955.98, 0.01
IMU_FIELDS, ALL_FIELDS = 0b111111, 0b1101111111111
GPS_EVERY = 10


class Step(NamedTuple):
    """Measurements of a step that ends at `t_s`: `force` and `rate` in the sensors' axes, lists of three.

    attitude : quaternion (4,) at the end of its block, from the hand's axes.
    """

    t_s: float
    force: list[float]
    rate: list[float]
    attitude: Vector


class Body:
    """Body of the vehicle in the hand.

    Parameters
    ----------
    port : of the simulator's sensors. hand, arm : its kind, and how it is held.
    seed : of the hand and of the skew. cross_axis : standard deviation of the accelerometers' cross-axis sensitivities.

    Attributes
    ----------
    t_s : time of the motion. up : (3,) unit vector in the vehicle's axes. skew : (3, 3) of the accelerometers.
    mounting : R_b, from the sensors' axes, in which the simulator's body is, to the vehicle's.
    """

    def __init__(self, port: int, hand: str, arm: str, seed: int, cross_axis: float) -> None:
        of_hand, of_motion, of_skew = np.random.default_rng(seed).spawn(3)
        self.skew = np.where(np.eye(3, dtype=bool), 1.0, of_skew.normal(0.0, cross_axis, (3, 3)))
        self._motion = Motion(HANDS[hand](of_hand), of_motion, STANDARD_GRAVITY_MPS2, disturbance=ARMS[arm])
        self._lock = threading.Lock()
        self._port = port
        self.t_s = self._booted_s = self._moved_s = 0.0
        self.up = np.array([0.0, 0.0, -1.0])
        self.mounting = np.eye(3)
        threading.Thread(target=self._serve, daemon=True).start()

    def hear(self, kind: str, down: tuple[float, float, float] | None) -> None:
        """Hear a prompt, whose `down` is in the vehicle's axes."""
        with self._lock:
            self._motion.hear(ReceivedPrompt(kind, None if down is None else to_hand_axes(down)), self.t_s)

    @property
    def still_s(self) -> float:
        """Time for which it has not been turned."""
        return self.t_s - self._moved_s

    def needs(self, held: Mapping[str, float]) -> dict[int, Correction]:
        """Return the parameters that each IMU needs, by its number from 1, of a vehicle that holds `held`."""
        raise NotImplementedError

    def _serve(self) -> None:
        raise NotImplementedError

    def _steps(self, rate_hz: int, count: int) -> Iterator[Step]:
        """Yield the next `count` steps; `t_s` is to be that of the last one before more are asked for."""
        with self._lock:
            edges = self.t_s + np.arange(count + 1) / rate_hz
            force, rate = (means @ FROM_HAND @ self.mounting for means in self._motion.means(edges))
            attitude = self._motion.attitude(float(edges[-1]))
        self.up = up_in_board(attitude) @ FROM_HAND
        if np.abs(rate).max() > TURNED_RAD_S:
            self._moved_s = float(edges[-1])
        for t_s, felt, turn in zip(edges[1:].tolist(), (force @ self.skew.T).tolist(), rate.tolist(), strict=True):
            yield Step(t_s, felt, turn, attitude)


class JsonBody(Body):
    """Body for ArduPilot's SITL, which asks for each step over UDP."""

    def needs(self, held: Mapping[str, float]) -> dict[int, Correction]:
        """See Body. SIM_ACCn_BIAS and SIM_ACCn_SCAL, of which a scale of 0 is taken as 1."""
        found = {}
        for imu in range(1, round(held["SIM_IMU_COUNT"]) + 1):
            bias, scale = (np.array([held[f"SIM_ACC{imu}_{kind}_{a}"] for a in AXES]) for kind in KINDS_OF_ERROR)
            found[imu] = Correction(bias, np.where(scale == 0, 1.0, scale))
        return found

    def _serve(self) -> None:
        served = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        served.bind((LOOPBACK, self._port))
        ahead: deque[Step] = deque()
        answer, last = b"", -1
        while True:
            data, sitl = served.recvfrom(1024)
            magic, rate_hz, count = HEAD.unpack_from(data)
            if magic not in MAGIC:
                continue
            # a repeated request gets the same answer
            if count != last or not answer:
                # the clock of a SITL starts with the program
                self._booted_s = self.t_s if count < last else self._booted_s
                if not ahead:
                    ahead.extend(self._steps(rate_hz, BLOCK))
                answer = self._answer(ahead.popleft())
            last = count
            served.sendto(answer, sitl)

    def _answer(self, step: Step) -> bytes:
        self.t_s = step.t_s
        w, x, y, z = step.attitude.tolist()
        at = {"position": [0, 0, 0], "velocity": [0, 0, 0], "quaternion": [w, x, -y, -z]}
        told = {"timestamp": self.t_s - self._booted_s, "imu": {"gyro": step.rate, "accel_body": step.force}, **at}
        # its parser wants no space after a colon
        return f"\n{json.dumps(told, separators=(',', ':'))}\n".encode()


class HilBody(Body):
    """Body for PX4's simulator, which connects over TCP, and whose clock is that of the HIL_SENSOR messages it gets."""

    def __init__(self, port: int, hand: str, arm: str, seed: int, cross_axis: float) -> None:
        self._noise = rng = np.random.default_rng([seed, HIL_IMUS])
        biases = rng.uniform(-MOST_BIAS_MPS2, MOST_BIAS_MPS2, (HIL_IMUS, 3))
        scales = rng.uniform(1 - MOST_SCALE, 1 + MOST_SCALE, (HIL_IMUS, 3))
        self._errors = [Correction(bias, scale) for bias, scale in zip(biases, scales, strict=True)]
        self._gyro_biases = rng.normal(0.0, GYRO_BIAS_RAD_S, (HIL_IMUS, 3))
        super().__init__(port, hand, arm, seed, cross_axis)

    def needs(self, held: Mapping[str, float]) -> dict[int, Correction]:
        """See Body. The simulator has no errors of its own: they are drawn here."""
        return dict(enumerate(self._errors, start=1))

    def _serve(self) -> None:
        server = socket.create_server((LOOPBACK, self._port))
        while True:
            px4, _ = server.accept()
            # a simulator that was rebooted connects again
            self._booted_s = self.t_s
            with suppress(OSError), px4:
                self._feed(px4)

    def _feed(self, px4: socket.socket) -> None:
        mav = dialect().MAVLink(None)
        begun_s, blocks = time.monotonic() - self.t_s, 0
        while True:
            for last, step in enumerate(self._steps(HIL_HZ, HIL_BLOCK), start=1 - HIL_BLOCK):
                time.sleep(max(begun_s + step.t_s - time.monotonic(), 0.0))
                # a busy machine delays all clocks alike
                begun_s = max(begun_s, time.monotonic() - step.t_s - MOST_LATE_S)
                while select.select([px4], [], [], 0)[0]:
                    if not px4.recv(1 << 16):
                        return
                self.t_s = step.t_s
                us = round((step.t_s - self._booted_s) * 1e6)
                px4.sendall(b"".join(message.pack(mav) for message in self._measured(us, step, full=last == 0)))
            blocks += 1
            if blocks % GPS_EVERY == 0:
                gps = dialect().MAVLink_hil_gps_message(us, 3, 473977420, 85455940, 488000, 80, 80, *[0] * 4, 0, 12)
                px4.sendall(gps.pack(mav))

    def _measured(self, us: int, step: Step, *, full: bool) -> Iterator[Any]:
        """Yield HIL_SENSOR of each IMU, with magnetometer and barometer of the first if `full`."""
        for imu, (error, gyro_bias) in enumerate(zip(self._errors, self._gyro_biases, strict=True)):
            acc = step.force / error.scale + error.offset + self._noise.normal(0.0, NOISE_MPS2, 3)
            gyr = step.rate + gyro_bias + self._noise.normal(0.0, NOISE_RAD_S, 3)
            if imu == 0:
                acc, gyr = _whole(acc, ACC_LSB_MPS2), _whole(gyr, GYRO_LSB_RAD_S)
            slow, fields = [0.0] * 7, IMU_FIELDS
            if full and imu == 0:
                mag = FROM_HAND @ _turned(step.attitude, FROM_HAND @ FIELD) + self._noise.normal(0.0, MAG_NOISE, 3)
                pressure = PRESSURE_HPA + float(self._noise.normal(0.0, BARO_NOISE_HPA))
                slow, fields = [*mag.tolist(), pressure, 0.0, 488.0, 25.0], ALL_FIELDS
            yield dialect().MAVLink_hil_sensor_message(us, *acc.tolist(), *gyr.tolist(), *slow, fields, imu)


def _whole(value: Vector, lsb: float) -> Vector:
    """Return the nearest whole numbers of `lsb`, and a little more, as they are truncated then."""
    whole = np.rint(value / lsb)
    return np.asarray((whole + 0.25 * np.sign(whole)) * lsb)


def _turned(q: Vector, world: Vector) -> Vector:
    """Return a vector (3,) of the world in the axes of a body with the attitude q."""
    return product(product(conjugate(q), np.append(0.0, world)), q)[1:]
