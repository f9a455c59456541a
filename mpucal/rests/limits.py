"""Limits of stillness, the only ones: what a short window of samples may show of a board that rests.

The fit, the check of a later recording and the report ask for what a recording's own rests are like: a spread between
those of QUIET and ANY_HAND. The session calls still what is within HAND's, or is like the rests that it has seen, and
the verification finds that again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..data import Vector

# A noisier sensor may exceed the limits of spread by so many times its own noise, up to these.
TIMES_NOISE = 2.5
NOISIEST_GYRO_RAD_S, NOISIEST_ACC_MPS2 = 0.15, 0.5
# The MPU-6050's gyro may be off by 20 deg/s at rest; where its bias is not known, what turns faster than this turns.
MOST_BIAS_RAD_S = math.radians(30.0)
# Faster, the accelerometer says, it turns: neither a rest nor a bias of the gyroscope.
TURNS_RAD_S = 0.02


@dataclass(frozen=True)
class Limits:
    """Limits of a window at rest.

    Attributes
    ----------
    gyro_sd, acc_sd : standard deviations within it [rad/s], [m/s^2].
    gyro_step, acc_step : its means may be this far, beyond its spread, from those of the rest before it.
    gyro_mean : mean rate beside the gyroscope's bias, where that is known [rad/s]: a turn at a constant rate has no
        spread, only a mean.
    vibration : where a window's variance is less than so many times that of its noise, the board is not moved.
    """

    gyro_sd: float
    acc_sd: float
    gyro_step: float
    acc_step: float
    gyro_mean: float = 0.05
    vibration: float = 5.0

    def wider(self, gyro_sd: float) -> Limits:
        """Limits for a hand whose rate spreads up to `gyro_sd` [rad/s] at rest; acc_sd grows in proportion."""
        return replace(self, gyro_sd=gyro_sd, acc_sd=self.acc_sd * gyro_sd / self.gyro_sd)


# Nobody touches the board: its mean acceleration is that of another look, to the last mg.
UNTOUCHED = Limits(gyro_sd=0.03, acc_sd=0.06, gyro_step=0.02, acc_step=0.03, vibration=2.0)
# A board on a table that hums, or in a hand whose elbow is braced.
QUIET = Limits(gyro_sd=0.03, acc_sd=0.15, gyro_step=0.02, acc_step=0.08)
# A hand trembles by 0.1 m/s^2 and 1 deg/s at 2 to 10 Hz.
HAND = Limits(gyro_sd=0.06, acc_sd=0.3, gyro_step=0.06, acc_step=0.3, gyro_mean=0.12)
# The most that any hand trembles (7 deg/s) in an orientation that it means to keep.
ANY_HAND = Limits(gyro_sd=0.12, acc_sd=0.6, gyro_step=0.06, acc_step=0.3, gyro_mean=0.12)

# So many standard deviations may the logarithm of a window's spread be above the median of windows that may be rests.
LIKE_THE_OTHERS = 2.0
LEAST_DEVIATION = 0.15  # of the logarithm, by chance: a window holds few periods of a tremor
OF_NORMAL = 1.4826  # a standard deviation beside the median of distances
LEAST_OF_QUIET, LEAST_OF_NOISE = 0.1, 0.5  # a smaller spread than these shares is chance


def learned(spread: Vector, speed: Vector, noise: float, fewest: float, limits: Limits = QUIET) -> Limits:
    """The limits of rests like those of these windows: no narrower than `limits`, no wider than ANY_HAND's.

    The windows that may be rests have a spread within ANY_HAND's and a mean rate within QUIET's. The logarithms of
    their spreads have a median and a standard deviation; the limit lies LIKE_THE_OTHERS of these above it.

    spread : (m,) rad/s, the largest standard deviation of the rate's axes beyond noise, which is `noise` [rad/s].
    speed : (m,) rad/s, the largest mean rate beside the bias. fewest : of so few windows that may be rests nothing is
    learned.
    """
    may_rest = (spread < ANY_HAND.gyro_sd) & (speed < QUIET.gyro_mean)
    if np.count_nonzero(may_rest) <= fewest:
        return limits
    size = np.log(np.maximum(spread[may_rest], max(LEAST_OF_QUIET * QUIET.gyro_sd, LEAST_OF_NOISE * noise)))
    median = np.median(size)
    deviation = max(OF_NORMAL * float(np.median(np.abs(size - median))), LEAST_DEVIATION)
    likely = float(np.exp(median + LIKE_THE_OTHERS * deviation))
    return limits.wider(min(max(likely, limits.gyro_sd), ANY_HAND.gyro_sd))
