"""Feeds: where the chip's samples come from, a motion or a recording. Knows no register."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...data import Vector
from ...errors import RecordingError, UsageError
from .motion import Motion
from .sensor import FULL_SCALE, Counts, Response, Setting, Truth

RECORDED_C = 25.0


class Feed(Protocol):
    """Gives the next samples, at the chip's sample clock."""

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """(n, 7) int16 in register order between (n + 1,) times [s]; fewer where the feed has ended."""
        ...


class SensorFeed:
    """What a sensor of known truth measures of a motion."""

    def __init__(self, truth: Truth, motion: Motion, rng: np.random.Generator) -> None:
        self._truth, self._motion, self._rng = truth, motion, rng
        self._set: tuple[Setting, Response] | None = None

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """The samples between (n + 1,) times [s]; it never ends."""
        if self._set is None or self._set[0] is not setting:
            self._set = setting, self._truth.response(setting)
        return self._set[1].counts(*self._motion.means(edges_s), self._rng)


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
        self._recorded = {"Hz": rate_hz, "g": accel_range_g, "deg/s": gyro_range_dps}

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """The next samples, at 25 C; fewer than asked for at the end.

        Raises
        ------
        UsageError : the chip is set to another rate or range than the recording's.
        """
        self._check(setting)
        part = slice(self._next, self._next + len(edges_s) - 1)
        acc, gyr = self._acc[part], self._gyr[part]
        self._next += len(acc)
        temperature = round((RECORDED_C - setting.zero_c) * setting.lsb_per_c)
        return np.hstack((acc, np.full((len(acc), 1), temperature, np.int16), gyr))

    def _check(self, setting: Setting) -> None:
        chosen = {"Hz": setting.rate_hz, "g": setting.accel_range_g, "deg/s": setting.gyro_range_dps}
        for unit, recorded in self._recorded.items():
            if not np.isclose(chosen[unit], recorded, rtol=0.01):
                raise UsageError(
                    f"the chip is set to {chosen[unit]:g} {unit}, the recording to {recorded:g} {unit}",
                    "set the chip to the same",
                )


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
