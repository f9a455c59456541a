"""Feeds of a simulated chip: numbered samples, and the counts of a recording."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpucal.data import STANDARD_GRAVITY_MPS2, Samples, Vector
from mpucal.simulated.chip import Chip, SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.models import MODELS
from mpucal.simulated.sensor import FULL_SCALE, Counts, Setting

RECORDED_C = 25.0
# A driver that has not identified the chip yet may set it otherwise.
UNSET_S = 1.0

# of the words but accelerometer x and z
CONSTANT = {1: -700, 3: -2000, 4: 1500, 5: -1600, 6: 1700}
NUMBERS = 30000


class NumberedFeed:
    """Feed with the number of the sample in accelerometer x, modulo NUMBERS, 1 g in z, and CONSTANT."""

    def __init__(self) -> None:
        self._next = 0

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return the next samples."""
        n = len(edges_s) - 1
        rows = np.zeros((n, 7), np.int16)
        rows[:, 0] = np.arange(self._next, self._next + n) % NUMBERS
        rows[:, 2] = round(FULL_SCALE / setting.accel_range_g)
        rows[:, list(CONSTANT)] = list(CONSTANT.values())
        self._next += n
        return rows


def numbers(samples: Samples) -> NDArray[np.int_]:
    """Return the numbers of samples that were measured at ±4 g."""
    return np.rint(samples.acc[:, 0] / STANDARD_GRAVITY_MPS2 * FULL_SCALE / 4.0).astype(int)


def open_recorded(
    acc_counts: ArrayLike,
    gyr_counts: ArrayLike,
    rate_hz: float,
    accel_range_g: float,
    gyro_range_dps: float,
    *,
    rate_error_ppm: float = 0.0,
) -> SimulatedBus:
    """Return a simulated MPU-6050 that serves the int16 counts (n, 3) of a recording, then raises EndOfCapture.

    The driver must give it the settings of the recording; its sample clock is `rate_error_ppm` faster than `rate_hz`.
    """
    feed = RecordedFeed(np.array([acc_counts, gyr_counts]), (rate_hz, accel_range_g, gyro_range_dps))
    return SimulatedBus(Chip(MODELS["mpu6050"], feed, rate_error_ppm), FastClock())


class RecordedFeed:
    """Feed of counts (2, n, 3), unchanged, one a sample; `settings`: their rate [Hz] and ranges [g, deg/s]."""

    def __init__(self, counts: Vector, settings: tuple[float, float, float]) -> None:
        assert (counts == counts.astype(np.int16)).all()
        self._counts, self._settings, self._next = counts.astype(np.int16), settings, 0

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return the next samples, fewer than requested at the end; of a board that lies flat until it is set."""
        n, temperature = len(edges_s) - 1, round((RECORDED_C - setting.zero_c) * setting.lsb_per_c)
        chosen = setting.rate_hz, setting.accel_range_g, setting.gyro_range_dps
        if not np.allclose(chosen, self._settings, rtol=0.01):
            assert self._next == 0 and edges_s[-1] < UNSET_S, f"set to {chosen}, recorded with {self._settings}"
            flat = [0, 0, round(FULL_SCALE / setting.accel_range_g), temperature, 0, 0, 0]
            return np.tile(np.array(flat, np.int16), (n, 1))
        acc, gyr = self._counts[:, self._next : self._next + n]
        self._next += len(acc)
        return np.hstack((acc, np.full((len(acc), 1), temperature, np.int16), gyr))
