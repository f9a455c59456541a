"""IMUs of a vehicle in one hand, with the measurements of each in its own axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...chip.families import MPU6500
from ...chip.registers import ACCEL_RANGES_G, GYRO_RANGES_DPS
from ...data import Vector
from ...mavlink.texts import Direction, Prompt, ReceivedPrompt
from ..disturbance import ARMS
from ..faults import begin_mishaps
from ..hands import HANDS
from ..motion import Motion
from ..sensor import SensorResponse, SensorTruth, Setting
from .options import VehicleOptions

# The hand's axes have z up, a vehicle's have z down.
FROM_HAND = np.diag([1.0, -1.0, -1.0])
BLOCK = 40
# Autopilots estimate the gyroscope's bias at each start; this share, up to 0.6 deg/s, is left by warming.
GYRO_BIAS_LEFT = 0.12
GYRO_BIAS_AT_START_RAD_S = 5e-4


class Imus:
    """IMUs of one vehicle: rigidly joined, each with its own errors.

    Parameters
    ----------
    rotation : R_b (3, 3), from their axes to the vehicle's. rate_hz : of the samples. gravity : m/s^2.
    """

    def __init__(self, options: VehicleOptions, rotation: Vector, rate_hz: float, gravity: float) -> None:
        of_hand, of_motion, self._rng = np.random.default_rng([options.seed, 3]).spawn(3)
        hand, mishaps = HANDS[options.hand](of_hand), begin_mishaps(options.fault)
        self._motion = Motion(hand, of_motion, gravity, mishaps, ARMS[options.arm])
        self._rotation, self._rate_hz = rotation, rate_hz
        self.truths = tuple(_truth(options.seed, number, gravity) for number in range(options.imus))
        # Autopilots set the largest ranges.
        ranges = float(max(ACCEL_RANGES_G)), float(max(GYRO_RANGES_DPS))
        self._setting = Setting(rate_hz, *ranges, MPU6500.lsb_per_c, MPU6500.zero_c)
        self._responses = [truth.response(self._setting) for truth in self.truths]
        self._sample, self._warmer_c = 0, 0.0

    @property
    def temperature_c(self) -> float:
        """Temperature of the dies."""
        return self.truths[0].temperature_c + self._warmer_c

    def hear(self, prompt: Prompt, t_s: float) -> None:
        """Pass a prompt to the hand, with `down` in the vehicle's axes."""
        down = prompt.down
        self._motion.hear(ReceivedPrompt(str(prompt.kind), None if down is None else to_hand_axes(down)), t_s)

    def restart(self) -> None:
        """Estimate the gyroscopes' biases again, as an autopilot does, which leaves a little of each."""
        for imu, true in enumerate(self.truths):
            left = self._rng.normal(0.0, GYRO_BIAS_AT_START_RAD_S, 3)
            self._responses[imu] = true._replace(b_omega=true.b_omega + left).response(self._setting)

    def next(self) -> Vector:
        """Return the next samples (BLOCK, imus, 2, 3): specific force [m/s^2] and rate [rad/s] in the sensors' axes."""
        edges = (self._sample + np.arange(BLOCK + 1)) / self._rate_hz
        self._sample += BLOCK
        self._warmer_c = float(self._motion.warmer_c(edges)[-1])
        force, rate = (means @ FROM_HAND @ self._rotation for means in self._motion.means(edges))
        return np.stack([self._in_si(response, force, rate) for response in self._responses], axis=1)

    def truth(self, number: int, offset: Vector, scale: Vector, mounting: Vector | None = None) -> dict[str, Any]:
        """Return the truth of IMU `number`'s stream in the vehicle's axes, under the parameters `offset` and `scale`.

        The stream is R_b diag(scale) (raw - offset), and raw = D R_b^T s + b_a.

        Parameters
        ----------
        mounting : R_b, if it is not that of the board alone.
        """
        R, true = self._rotation if mounting is None else mounting, self.truths[number]
        stream = true._replace(
            D=R @ np.diag(scale) @ true.D @ R.T,
            b_a=R @ (scale * (true.b_a - offset)),
            K=R @ true.K @ R.T,
            b_omega=R @ true.b_omega,
        )
        return stream.document()

    def _in_si(self, response: SensorResponse, force: Vector, rate: Vector) -> Vector:
        counts = response.counts(force, rate, self._rng)
        acc, gyr = counts[:, :3] * self._setting.mps2_per_lsb, counts[:, 4:] * self._setting.rad_s_per_lsb
        return np.stack((acc, gyr), axis=1)


def to_hand_axes(down: Direction) -> Direction:
    """Return a direction of the vehicle's axes in the hand's axes."""
    x, y, z = down
    return x, -y, -z


def _truth(seed: int, number: int, gravity: float) -> SensorTruth:
    """Draw the errors of IMU `number`; the chips on an autopilot are of the newer kind."""
    drawn = SensorTruth.draw(seed + 1000 * number, "mpu6500", gravity)
    return drawn._replace(b_omega=drawn.b_omega * GYRO_BIAS_LEFT, rate_error_ppm=0.0)
