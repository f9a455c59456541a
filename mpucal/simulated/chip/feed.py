"""Feed of a simulated chip: samples of a sensor in motion."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...data import Vector
from ..motion import Motion
from ..sensor import Counts, SensorResponse, SensorTruth, Setting

TEMPERATURE = 3


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
