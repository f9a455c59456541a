"""What changes in a sensor while it is turned, in SI units.

Where D or b_a moves, what is compared as the truth is its mean over the recording after the flat segment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpucal.data import STANDARD_GRAVITY_MPS2

from .course import FLAT_S, direction
from .faults import Readings

MG_MPS2 = 1e-3 * STANDARD_GRAVITY_MPS2


@dataclass(frozen=True)
class GyroMoves:
    """The gyroscope's bias: it drifts by drift_dps in 90 s, and steps by step_dps midway."""

    drift_dps: float = 0.0
    step_dps: float = 0.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        drift = self.drift_dps / 90.0 * readings.t[:, None] * direction(rng)
        stepped = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
        step = self.step_dps * stepped[:, None] * direction(rng)
        return replace(readings, gyr=readings.gyr + np.radians(drift + step))


@dataclass(frozen=True)
class ZeroStep:
    """The accelerometer's zero steps by `mg` in some direction, midway."""

    mg: float = 10.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        after = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
        return readings.zero_moved(self.mg * MG_MPS2 * after[:, None] * direction(rng))


@dataclass(frozen=True)
class Stress:
    """How the board is held bends it: in each pose the accelerometer's zero is elsewhere, by `mg` rms an axis."""

    mg: float = 3.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        pose = np.cumsum(np.diff((readings.moving > 0.5).astype(int), prepend=0) > 0)
        zeros = self.mg * MG_MPS2 * rng.standard_normal((pose[-1] + 1, 3))
        return readings.zero_moved(zeros[pose])


@dataclass(frozen=True)
class Warming:
    """Warms by `by_c` with a time constant of tau_s; both biases follow, within what data sheets allow."""

    by_c: float = 20.0
    tau_s: float = 300.0
    mg_per_c: float = 0.8
    dps_per_c: float = 0.02

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        warmer = self.by_c * (1.0 - np.exp(-readings.t / self.tau_s))[:, None]
        moved = readings.zero_moved(self.mg_per_c * MG_MPS2 * rng.uniform(-1, 1, 3) * warmer)
        gyr = readings.gyr + np.radians(self.dps_per_c) * rng.uniform(-1, 1, 3) * warmer
        return replace(moved, gyr=gyr, temperature_c=readings.temperature_c + warmer[:, 0])


@dataclass(frozen=True)
class Slip:
    """The accelerometer slips on its mount by `deg` midway, and the gyroscope does not; the true D is the mean."""

    deg: float = 3.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        after = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
        turn = np.cross(np.eye(3), np.radians(self.deg) * direction(rng))
        D, share = readings.truth.D, after[readings.t >= FLAT_S].mean()
        acc = readings.acc + after[:, None] * (readings.force @ (D @ turn).T)
        return replace(readings, acc=acc, truth=replace(readings.truth, D=D + share * D @ turn))


@dataclass(frozen=True)
class Teleport:
    """A simulator is reset: for the last `seconds` the board is back where it lay, and no rate told of the way."""

    seconds: float = 8.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        n = int(np.searchsorted(readings.t, self.seconds))
        acc, gyr = readings.acc.copy(), readings.gyr.copy()
        acc[-n:], gyr[-n:] = acc[:n], gyr[:n]
        return replace(readings, acc=acc, gyr=gyr)
