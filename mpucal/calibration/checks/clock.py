"""The check of the clock that the samples' times come from, where that is not the host's."""

from __future__ import annotations

from ...reasons import Reason, reason
from ..evidence import Evidence

# A quartz crystal is within 100 ppm; a scale factor that is off by as much as these is a tenth of what is aimed at.
OFF_PPM, UNKNOWN = 500.0, 500e-6
# they estimate no scale factor of the gyroscope
TRUSTING = ("accel", "paper", "tilt")


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
