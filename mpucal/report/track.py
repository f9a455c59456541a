"""A recording with its calibration: rests, calibrated samples, innovations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..calibration.likelihood import trace
from ..calibration.preprocessing import Preprocessed, preprocess
from ..calibration.theta import Theta
from ..data import Mask, Recording, Vector
from ..rests.flat import find_flat, flat_statistics
from ..rests.intervals import Intervals, RestFinder
from ..result.calibration import Calibration

# typical acceleration of a moving hand, for the filter behind the innovations
HAND_MPS2 = 0.5


@dataclass(frozen=True)
class Track:
    """Recording with its calibration, and quantities derived from both; D must be regular."""

    recording: Recording
    calibration: Calibration

    @cached_property
    def t(self) -> Vector:
        """Return (n,) s since the first sample."""
        return np.asarray(self.recording.t - self.recording.t[0])

    @property
    def gravity(self) -> float:
        """Return gravity as the calibration assumed it [m/s^2]."""
        return self.calibration.gravity

    @cached_property
    def calibrated(self) -> Vector:
        """Return (n, 3) m/s^2 by equation (4)."""
        return np.asarray(self.calibration.apply(self.recording.acc))

    @cached_property
    def flat(self) -> tuple[int, int] | None:
        """Return (first, last + 1) of the flat segment; None if there is none, or nothing after it."""
        flat = self.recording.flat or find_flat(self.recording)
        if flat is None or flat[1] - flat[0] < 2 or flat[1] >= len(self.recording) - 1:
            return None
        return flat

    @cached_property
    def runs(self) -> Intervals:
        """Return (k, 2): first and last + 1 of the samples of each rest."""
        if self.flat is None:
            return np.zeros((0, 2), np.intp)
        return RestFinder(self.recording, flat_statistics(self.recording, self.flat)).typical()

    @cached_property
    def resting(self) -> Mask:
        """Return (n,) True where the board rests."""
        mask = np.zeros(len(self.recording), bool)
        for first, last in self.runs:
            mask[first:last] = True
        return mask

    def at_rest(self, acc: Vector) -> Vector:
        """Return (k, 3) means of `acc` (n, 3) over each rest."""
        return np.array([acc[first:last].mean(0) for first, last in self.runs]).reshape(-1, 3)

    @cached_property
    def innovations(self) -> Vector | None:
        """Return (m, 3) m/s^2: the last m calibrated measurements minus gravity as predicted by the gyroscope.

        This is inv(D) e of equation (8), by the hand's filter. None if the filter cannot run.
        """
        c = self.calibration
        known = (c.D, c.b_a, c.K, c.b_omega)
        if self.flat is None or not all(np.isfinite(values).all() for values in known):
            return None
        prepared = preprocess(self.recording, self.flat, self.gravity)
        predicted = trace(prepared.white(HAND_MPS2), self._theta(prepared)).s
        return np.asarray(self.calibrated[-len(predicted) :] - predicted)

    def _theta(self, prepared: Preprocessed) -> Theta:
        c = self.calibration
        s = np.linalg.solve(c.D, prepared.flat.y - (c.b_a - c.applied_in_hardware))
        D, b_a = c.D, c.b_a - c.applied_in_hardware
        return replace(Theta.start(D, b_a, c.b_omega, s / np.linalg.norm(s)), K=c.K)
