"""Limits of stillness: what a short window of samples may show of a board that rests.

The fit, the check of a later recording and the report ask for what a recording's own rests are like: a spread between
those of QUIET and ANY_HAND. The verification asks for the rest of ANY_HAND as well: an orientation that the session
called held must be found again.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits of a window at rest; a sensor that is noisier at rest has wider ones of its own.

    Attributes
    ----------
    gyro_sd, acc_sd : standard deviations within a window [rad/s], [m/s^2].
    gyro_mean : mean rate beside the gyroscope's bias [rad/s]: a turn at a constant rate has no spread, only a mean.
    """

    gyro_sd: float
    acc_sd: float
    gyro_mean: float

    def wider(self, gyro_sd: float) -> Limits:
        """Limits for a hand whose rate spreads up to `gyro_sd` [rad/s] at rest; acc_sd grows in proportion."""
        return Limits(gyro_sd, self.acc_sd * gyro_sd / self.gyro_sd, self.gyro_mean)


# A board on a table that hums, or in a hand whose elbow is braced.
QUIET = Limits(gyro_sd=0.03, acc_sd=0.15, gyro_mean=0.05)
# The most that any hand trembles (7 deg/s) in an orientation that it means to keep.
ANY_HAND = Limits(gyro_sd=0.12, acc_sd=0.6, gyro_mean=0.12)
