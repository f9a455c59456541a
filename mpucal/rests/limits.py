"""Limits of stillness, the only ones: the spread and the mean rate of a short window at rest.

The fit, the check of a later recording and the report use limits between QUIET and ANY_HAND that the recording's own
rests give. The session uses HAND's limits, or those of the rests so far, and the verification finds the same rests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..data import Vector

# A noisy sensor may exceed the limits of spread, up to this multiple of its own noise and up to these values.
TIMES_NOISE = 2.5
NOISIEST_GYRO_RAD_S, NOISIEST_ACC_MPS2 = 0.15, 0.5
VIBRATING_MPS2 = 0.2  # the noise of no sensor
# The MPU-6050's bias may be 20 deg/s; where the bias is not known, a larger mean rate than this is a turn.
MOST_BIAS_RAD_S = math.radians(30.0)
# A window in which gravity turns faster is neither a rest nor a measurement of the gyroscope's bias.
TURNS_RAD_S = 0.02
# A hand that turns the board moves it at this rate, and gravity by this angle, which biases and skew do not explain.
# Orientations so far apart count as different: 12 of them are far from parallel, and a sphere holds some seventy.
MOVING_RAD_S = 0.3
LEAST_TURN_RAD = math.radians(20.0)
# So many orientations, on all sides, show a sensor well where nothing disturbs it.
ENOUGH_ORIENTATIONS = 10


@dataclass(frozen=True)
class Limits:
    """Limits for a window at rest.

    Attributes
    ----------
    gyro_sd, acc_sd : standard deviations within it [rad/s], [m/s^2].
    gyro_step, acc_step : distance of its means from those of the rest before it, beyond its spread.
    gyro_mean : mean rate less the gyroscope's bias, where that is known [rad/s]: a turn at a constant rate has no
        spread, only a mean.
    vibration : a window whose variance is less than this many times that of its noise vibrates, and is not moved.
    """

    gyro_sd: float
    acc_sd: float
    gyro_step: float
    acc_step: float
    gyro_mean: float = 0.05
    vibration: float = 5.0

    def wider(self, gyro_sd: float) -> Limits:
        """Return limits for a hand whose rate spreads up to `gyro_sd` [rad/s]; acc_sd grows in proportion."""
        return replace(self, gyro_sd=gyro_sd, acc_sd=self.acc_sd * gyro_sd / self.gyro_sd)


# For a board on a table that hums, or in a hand with a braced elbow.
QUIET = Limits(gyro_sd=0.03, acc_sd=0.15, gyro_step=0.02, acc_step=0.08)
# For a board that nobody touches: its mean acceleration repeats to the last mg.
UNTOUCHED = replace(QUIET, acc_sd=0.06, acc_step=0.03, vibration=2.0)
# For a hand, which trembles by 0.1 m/s^2 and 1 deg/s at 2 to 10 Hz.
HAND = Limits(gyro_sd=0.06, acc_sd=0.3, gyro_step=0.06, acc_step=0.3, gyro_mean=0.12)
# For the strongest tremor (7 deg/s) of a hand that holds an orientation.
ANY_HAND = Limits(gyro_sd=0.12, acc_sd=0.6, gyro_step=0.06, acc_step=0.3, gyro_mean=0.12)

# The logarithm of a rest's spread lies at most this many standard deviations above the median of possible rests.
LIKE_THE_OTHERS = 2.0
LEAST_DEVIATION = 0.15  # of the logarithm, by chance: a window holds only few periods of a tremor
OF_NORMAL = 1.4826  # ratio of a normal standard deviation to the median absolute deviation
LEAST_OF_QUIET, LEAST_OF_NOISE = 0.1, 0.5  # a smaller spread than these shares is chance


def learned(spread: Vector, speed: Vector, noise: float, fewest: float, limits: Limits = QUIET) -> Limits:
    """Learn the limits of rests from windows: no narrower than `limits`, no wider than ANY_HAND's.

    Possible rests have a spread within ANY_HAND's and a mean rate within QUIET's. The limit lies LIKE_THE_OTHERS
    standard deviations of the logarithm of their spreads above its median.

    spread : (m,) rad/s, the largest standard deviation of the rate's axes beyond noise, which is `noise` [rad/s].
    speed : (m,) rad/s, the largest mean rate of the axes, less the bias.
    fewest : number of possible rests from which nothing is learned; there must be more.
    """
    may_rest = (spread < ANY_HAND.gyro_sd) & (speed < QUIET.gyro_mean)
    if np.count_nonzero(may_rest) <= fewest:
        return limits
    size = np.log(np.maximum(spread[may_rest], max(LEAST_OF_QUIET * QUIET.gyro_sd, LEAST_OF_NOISE * noise)))
    middle = _median(size)
    deviation = max(OF_NORMAL * _median(np.abs(size - middle)), LEAST_DEVIATION)
    likely = float(np.exp(middle + LIKE_THE_OTHERS * deviation))
    return limits.wider(min(max(likely, limits.gyro_sd), ANY_HAND.gyro_sd))


def _median(values: Vector) -> float:
    """Return the median of (m,), at a tenth of the time that np.median takes for a few values."""
    middle = (len(values) - 1) // 2, len(values) // 2
    parted = np.partition(values, middle)
    return float(parted[middle[0]] + parted[middle[1]]) / 2.0
