"""Poses of a hand that holds the board still: the mean specific force of each rest, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from ..rests.intervals import Intervals, statistics
from .problem import Problem
from .rotation import cross_rows
from .theta import Theta

POSE_MPS2 = 0.0003  # standard deviation of a rest's mean, since no mounting is perfectly stiff
SPEED_OF_TREMOR_S = 0.04  # ratio of a tremor's speed to its acceleration


@dataclass(frozen=True)
class Poses:
    """Poses of k rests, with sums over their samples that serve for any theta.

    Z = (-integral of omega, -time) since a rest's first sample: K (I, -b_omega) Z is the angle turned since then.

    Attributes
    ----------
    spans : k - 1 slices, the steps of the series from one rest to the next. of_gyro, variance : (k - 1,) rad^2 an axis,
        of the angle by which these miss the next rest: by the gyroscope's noise, and by all noise.
    end : (k, 4) Z at the last sample. products : (k, 4, 4) means of Z (y, 1)'.
    mean : (k, 3) m/s^2, of y.
    """

    spans: list[slice]
    of_gyro: Vector
    variance: Vector
    end: Vector
    products: Vector
    mean: Vector

    @classmethod
    def of(cls, recording: Recording, flat: Flat, problem: Problem, runs: Intervals) -> Poses:
        """Sum over the samples of the rests `runs` (k, 2)."""
        series = problem.series
        Z = np.zeros((len(recording), 4))
        np.cumsum(np.column_stack([-series.dt[:, None] * series.omega, -series.dt]), axis=0, out=Z[flat.last :])
        y = np.column_stack([recording.acc, np.ones(len(recording))])
        end, products = np.zeros((len(runs), 4)), np.zeros((len(runs), 4, 4))
        for k, (first, last) in enumerate(runs.tolist()):
            of_rest = Z[first:last] - Z[first]
            end[k], products[k] = of_rest[-1], of_rest.T @ y[first:last] / (last - first)
        (mean, spread), n = statistics(recording.acc, runs), runs[:, 1] - runs[:, 0]
        tremor = np.maximum(np.mean(spread - flat.Sigma_a, axis=1), 0.0)
        of_tremor = 2.0 * tremor * (SPEED_OF_TREMOR_S * recording.rate_hz / n) ** 2
        direction = (POSE_MPS2**2 + flat.Sigma_a.mean() / n + of_tremor) / problem.gravity**2
        spans = [slice(*span) for span in zip(runs[:-1, 1] - flat.last, runs[1:, 0] + 1 - flat.last, strict=True)]
        of_gyro = flat.Sigma_omega.mean() * np.array([series.dt[span] @ series.dt[span] for span in spans])
        variance = of_gyro + direction[:-1] + direction[1:]
        if series.q_extra is not None:
            variance += [series.q_extra[span].sum() for span in spans]
        return cls(spans, of_gyro, variance, end, products, mean)

    def forces(self, theta: Theta) -> tuple[Vector, Vector]:
        """Return the mean specific forces (k, 3) [m/s^2], in the body's axes at each rest's first and last sample.

        A board in a hand turns a little as it rests: each sample is rotated into the axes of either end.
        """
        inverse = theta.inverse
        s = (self.mean - theta.b_a) @ inverse.T
        of_Z = np.column_stack([theta.K, -theta.K @ theta.b_omega])
        of_y = np.column_stack([inverse, -inverse @ theta.b_a])
        m = of_Z @ self.products @ of_y.T  # means of the angle times s'
        across = np.stack([m[:, 1, 2] - m[:, 2, 1], m[:, 2, 0] - m[:, 0, 2], m[:, 0, 1] - m[:, 1, 0]], axis=1)
        return s - across, s - across + cross_rows(self.end @ of_Z.T, s)
