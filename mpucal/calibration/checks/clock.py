"""Checks of the samples' times: the clock that they come from, and whether both sensors have the same."""

from __future__ import annotations

from ...reasons import Reason, reason
from ..evidence import Evidence
from ..parameters import BY_NAME

# A quartz crystal is within 100 ppm; a scale factor that is off by as much as these is a tenth of what is aimed at.
OFF_PPM, UNKNOWN = 500.0, 500e-6
# they estimate no scale factor of the gyroscope
TRUSTING = ("accel", "paper", "tilt")
# What filters leave is 10 ms at most where both have the same; those of an autopilot are set by its owner, and differ.
LAG_S, SURE = 0.02, 5.0


def clock_off(e: Evidence) -> Reason | None:
    """A clock whose rate was corrected by much, or is known too little: the gyroscope's K has the same error."""
    ppm, std = e.recording.sensor.clock_ppm, e.recording.sensor.clock_std
    if ppm is None or std is None:
        return None
    if std > UNKNOWN:
        if e.model in TRUSTING:
            return reason("clock_off", "trusted", std=std * 1e6, model=e.model)
        return reason("clock_off", "unknown", std=std * 1e6)
    return reason("clock_off", "corrected", ppm=ppm, std=std * 1e6) if abs(ppm) > OFF_PPM else None


def apart(e: Evidence) -> Reason | None:
    """An accelerometer that lags behind the gyroscope, or runs ahead of it, by more than filters leave."""
    if e.fit is None or e.claim is None or e.recording.autopilot is not None:
        return None
    (of_prior,) = BY_NAME["tau"].sd
    std = float(e.fit.std("tau")[0]) / e.claim.inflation
    # what the data alone say: the prior draws the estimate towards what filters leave
    data, filters_s = 1.0 - (std / of_prior) ** 2, e.recording.sensor.accel_lag_s
    lag_s = filters_s + (e.fit.delay_s - filters_s) / data if data > 0.0 else 0.0
    if not data > 0.0 or abs(lag_s) < max(LAG_S, SURE * std / data**0.5):
        return None
    return reason("clock_off", "apart", lag=1e3 * abs(lag_s), how="lags behind" if lag_s > 0 else "runs ahead of")
