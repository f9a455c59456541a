"""All pictures of the report with their captions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from . import pictures, spheres
from .elements import figure
from .track import Track

RESIDUALS = "|a| of each rest minus gravity. Calibrated, all of them lie at zero, but for the hand's tremor."
MAGNITUDE = "|a| over time. At rest it should equal gravity in every orientation; while the board moves it does not."
SPHERE = (
    "Each dot is the mean of a rest. Calibrated, they lie on the sphere of gravity; hollow ones are on its far side. "
    "Uncalibrated, they lie on an ellipsoid beside it."
)
COVERAGE = (
    "Which way was up, in the board's axes: the upper and the lower half of a sphere, seen from above. Dots are rests, "
    "specks are turns; empty areas were not covered."
)


def gallery(track: Track) -> Mapping[str, str]:
    """The figures by name, empty where the recording does not have what they show."""
    return {
        "residuals": figure(pictures.residuals(track), RESIDUALS),
        "magnitude": figure(pictures.magnitude(track), MAGNITUDE),
        "sphere": figure(spheres.sphere(track), SPHERE),
        "innovations": figure(pictures.innovations(track), _about_innovations(track)),
        "coverage": figure(spheres.coverage(track), COVERAGE),
        "rates": figure(pictures.rates(track), _about_rates(track)),
        "temperature": figure(pictures.temperature(track), ""),
    }


def _about_innovations(track: Track) -> str:
    e = track.innovations
    if e is None:
        return ""
    resting = track.resting[-len(e) :]
    said = [
        f"{float(np.sqrt(np.mean(e[part] ** 2))):.2g} m/s² rms {where}"
        for part, where in ((resting, "at rest"), (~resting, "while it moves"))
        if part.any()
    ]
    return (
        "Innovation: the calibrated acceleration minus gravity as predicted by the gyroscope, "
        f"{' and '.join(said)} for each axis. At rest it should be noise around zero; while the board moves it is "
        "mostly the acceleration of the hand."
    )


def _about_rates(track: Track) -> str:
    fastest = float(np.degrees(np.abs(track.recording.gyr).max()))
    return f"Fastest: {fastest:.0f} deg/s. Rates beyond the range are clipped."
