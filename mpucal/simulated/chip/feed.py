"""Where a simulated chip's samples come from: a sensor in motion, or a recording."""

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
# until a driver has found out which chip it is, it may be set otherwise
UNSET_S = 1.0


class Feed(Protocol):
    """Gives the next samples, at the chip's sample clock."""

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """(n, 7) int16 in register order between (n + 1,) times [s]; fewer where the feed has ended."""
        ...


class SensorFeed:
    """What a sensor of known truth measures of a motion."""

    def __init__(self, truth: SensorTruth, motion: Motion, rng: np.random.Generator) -> None:
        self._truth, self._motion, self._rng = truth, motion, rng
        self._set: tuple[Setting, SensorResponse] | None = None

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """The samples between (n + 1,) times [s]; it never ends."""
        if self._set is None or self._set[0] is not setting:
            self._set = setting, self._truth.response(setting)
        counts = self._set[1].counts(*self._motion.means(edges_s, setting.accel_lag_s), self._rng)
        if self._motion.mishaps:
            warmer = np.rint(self._motion.warmer_c(edges_s) * setting.lsb_per_c).astype(np.int16)
            counts[:, TEMPERATURE] += warmer
        return counts


class RecordedFeed:
    """The counts of a recording, served as they are, one a sample.

    Parameters
    ----------
    acc_counts, gyr_counts : (n, 3) int16 values. rate_hz, accel_range_g, gyro_range_dps : as recorded.

    Raises
    ------
    RecordingError : counts that are no int16, or not as many of both.
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
        """The next samples, at 25 C; fewer than asked for at the end.

        A chip that is set otherwise than the recording lies flat meanwhile.

        Raises
        ------
        UsageError : it stays set to another rate or range.
        """
        temperature = round((RECORDED_C - setting.zero_c) * setting.lsb_per_c)
        if other := self._set_otherwise(setting):
            self._unset_s = float(edges_s[0]) if self._unset_s is None else self._unset_s
            if self._next or edges_s[-1] > self._unset_s + UNSET_S:
                raise other
            flat = [0, 0, round(FULL_SCALE / setting.accel_range_g), temperature, 0, 0, 0]
            return np.tile(np.array(flat, np.int16), (len(edges_s) - 1, 1))
        part = slice(self._next, self._next + len(edges_s) - 1)
        acc, gyr = self._acc[part], self._gyr[part]
        self._next += len(acc)
        return np.hstack((acc, np.full((len(acc), 1), temperature, np.int16), gyr))

    def _set_otherwise(self, setting: Setting) -> UsageError | None:
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
