"""Feeds of a simulated chip: samples of a sensor in motion, or of a recording."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...data import Vector
from ...errors import RecordingError, UsageError
from ..motion import Motion
from ..sensor import FULL_SCALE, Counts, SensorResponse, SensorTruth, Setting

RECORDED_C = 25.0
TEMPERATURE = 3
# A driver that has not identified the chip yet may set it otherwise.
UNSET_S = 1.0


class Feed(Protocol):
    """Source of the next samples, at the chip's sample clock."""

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return (n, 7) int16 in register order between (n + 1,) times [s]; fewer at the feed's end."""
        ...


class SensorFeed:
    """Feed of a sensor of known truth in motion."""

    def __init__(self, truth: SensorTruth, motion: Motion, rng: np.random.Generator) -> None:
        self._truth, self._motion, self._rng = truth, motion, rng
        self._set: tuple[Setting, SensorResponse] | None = None

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return the samples between (n + 1,) times [s]; the feed never ends."""
        if self._set is None or self._set[0] is not setting:
            self._set = setting, self._truth.response(setting)
        counts = self._set[1].counts(*self._motion.means(edges_s, setting.accel_lag_s), self._rng)
        if self._motion.mishaps:
            warmer = np.rint(self._motion.warmer_c(edges_s) * setting.lsb_per_c).astype(np.int16)
            counts[:, TEMPERATURE] += warmer
        return counts


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
