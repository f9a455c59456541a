"""Simulated chip that serves the counts of a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mpucal.data import Vector
from mpucal.errors import RecordingError, UsageError
from mpucal.simulated.chip import Chip, SimulatedBus
from mpucal.simulated.chip.clock import FastClock
from mpucal.simulated.chip.models import MODELS
from mpucal.simulated.sensor import FULL_SCALE, Counts, Setting

RECORDED_C = 25.0
# A driver that has not identified the chip yet may set it otherwise.
UNSET_S = 1.0


def open_recorded(
    acc_counts: ArrayLike,
    gyr_counts: ArrayLike,
    rate_hz: float,
    accel_range_g: float,
    gyro_range_dps: float,
    *,
    rate_error_ppm: float = 0.0,
    chip: str = "mpu6050",
) -> SimulatedBus:
    """Return a simulated chip that serves the int16 counts (n, 3) of a recording, then raises EndOfCapture.

    Its sample clock is `rate_error_ppm` faster than `rate_hz`, which the driver must set.

    Raises
    ------
    RecordingError : counts that are not int16, or different numbers of them.
    """
    feed = RecordedFeed(acc_counts, gyr_counts, rate_hz, accel_range_g, gyro_range_dps)
    return SimulatedBus(Chip(MODELS[chip], feed, rate_error_ppm), FastClock())


class RecordedFeed:
    """Feed of a recording's counts, unchanged, one a sample.

    Parameters
    ----------
    acc_counts, gyr_counts : (n, 3) int16 values. rate_hz, accel_range_g, gyro_range_dps : as recorded.

    Raises
    ------
    RecordingError : counts that are not int16, or different numbers of them.
    """

    def __init__(
        self,
        acc_counts: ArrayLike,
        gyr_counts: ArrayLike,
        rate_hz: float,
        accel_range_g: float,
        gyro_range_dps: float,
    ) -> None:
        acc, gyr = _counts(acc_counts, "accelerometer"), _counts(gyr_counts, "gyroscope")
        if len(acc) != len(gyr):
            raise RecordingError(
                f"the recording has {len(acc)} accelerometer and {len(gyr)} gyroscope samples",
                "give both of each",
            )
        self._acc, self._gyr = acc, gyr
        self._next = 0
        self._unset_s: float | None = None
        self._recorded = {"Hz": rate_hz, "g": accel_range_g, "deg/s": gyro_range_dps}

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return the next samples, at 25 C; fewer than requested at the end.

        While the chip's settings differ from the recording's, the samples are those of a board that lies flat.

        Raises
        ------
        UsageError : the settings still differ after UNSET_S.
        """
        temperature = round((RECORDED_C - setting.zero_c) * setting.lsb_per_c)
        if other := self._difference(setting):
            self._unset_s = float(edges_s[0]) if self._unset_s is None else self._unset_s
            if self._next or edges_s[-1] > self._unset_s + UNSET_S:
                raise other
            flat = [0, 0, round(FULL_SCALE / setting.accel_range_g), temperature, 0, 0, 0]
            return np.tile(np.array(flat, np.int16), (len(edges_s) - 1, 1))
        part = slice(self._next, self._next + len(edges_s) - 1)
        acc, gyr = self._acc[part], self._gyr[part]
        self._next += len(acc)
        return np.hstack((acc, np.full((len(acc), 1), temperature, np.int16), gyr))

    def _difference(self, setting: Setting) -> UsageError | None:
        chosen = {"Hz": setting.rate_hz, "g": setting.accel_range_g, "deg/s": setting.gyro_range_dps}
        for unit, recorded in self._recorded.items():
            if not np.isclose(chosen[unit], recorded, rtol=0.01):
                return UsageError(
                    f"the chip is set to {chosen[unit]:g} {unit}, the recording to {recorded:g} {unit}",
                    "set the chip to the same",
                )
        return None


def _counts(values: ArrayLike, of: str) -> Counts:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not _are_int16(array):
        raise RecordingError(
            f"the recording's {of} counts of shape {array.shape} are not (n, 3) whole numbers of 16 bits",
            "give the counts as the chip delivered them",
        )
    return array.astype(np.int16)


def _are_int16(values: Vector) -> bool:
    return bool(np.all((values == np.rint(values)) & (np.abs(values + 0.5) < FULL_SCALE)))
