"""The pictures of a recording with their captions: rests, magnitudes, innovations, rates and temperature over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..data import Vector
from ..origin import name_thing
from ..result.error_model import MG_PER_MPS2
from .elements import figure
from .figure import AFTER, BEFORE, INK, LINE, XYZ, Axes, dots
from .spheres import coverage, sphere
from .track import Track

BINS = 500
_TIME = "time [s]"
RESIDUALS = "|a| of each rest minus gravity. After calibration all should lie at zero, apart from hand tremor."
MAGNITUDE = "|a| over time. At rest it should equal gravity in every orientation; while the board moves it does not."
SPHERE = (
    "Each dot is the mean of a rest, where gravity pointed: after calibration on the sphere, before on an ellipsoid"
    " beside it. Hollow dots are on the far side."
)
COVERAGE = (
    "The direction that pointed down, in the board's axes and as on the screen: both halves of a sphere. Large dots: "
    "held still. Small dots: moving. Empty areas were not visited."
)


def gallery(track: Track) -> Mapping[str, str]:
    """Return the figures by name; empty if the recording lacks the data."""
    drawn = {
        "residuals": (residuals(track), RESIDUALS),
        "magnitude": (magnitude(track), MAGNITUDE),
        "sphere": (sphere(track), SPHERE),
        "innovations": (innovations(track), _about_innovations(track)),
        "coverage": (coverage(track), COVERAGE),
        "rates": (rates(track), _about_rates(track)),
        "temperature": (temperature(track), ""),
    }
    origin = track.calibration.sensor.origin
    return {name: figure(picture, name_thing(caption, origin)) for name, (picture, caption) in drawn.items()}


def _about_innovations(track: Track) -> str:
    e = track.innovations
    if e is None:
        return ""
    resting = track.resting[-len(e) :]
    rms = [
        f"{float(np.sqrt(np.mean(e[part] ** 2))):.2g} m/s² rms {where}"
        for part, where in ((resting, "at rest"), (~resting, "while it moves"))
        if part.any()
    ]
    return (
        "Innovation: the calibrated acceleration minus gravity as predicted by the gyroscope, "
        f"{' and '.join(rms)} for each axis. At rest it should be noise around zero; while the board moves it is "
        "mostly the acceleration of the hand."
    )


def _about_rates(track: Track) -> str:
    fastest = float(np.degrees(np.abs(track.recording.gyr).max()))
    return f"Fastest: {fastest:.0f} deg/s. Rates beyond the range are clipped."


def residuals(track: Track) -> str:
    """Draw |a| - g of each rest before and after; empty if there are no rests."""
    if not len(track.runs):
        return ""
    both = [
        MG_PER_MPS2 * (np.linalg.norm(track.at_rest(acc), axis=1) - track.gravity)
        for acc in (track.recording.acc, track.calibrated)
    ]
    most = 1.1 * max(float(np.abs(values).max()) for values in both) + 1e-3
    number = np.arange(1.0, len(track.runs) + 1.0)
    axes = Axes((0.5, len(number) + 0.5), (-most, most), "rest", "|a| − gravity [mg]")
    marks = [dots(*axes.place(number, v), 3.0, colour) for v, colour in zip(both, (BEFORE, AFTER), strict=True)]
    label = "|a| minus gravity at each rest"
    return axes.svg("residuals", label, [axes.level(0.0), *marks], ("before", BEFORE), ("after", AFTER))


def magnitude(track: Track) -> str:
    """Draw |a| over time before and after, as the paper's Fig. 2."""
    both = [np.linalg.norm(acc, axis=1) for acc in (track.recording.acc, track.calibrated)]
    axes = _over_time(track, _span(np.concatenate(both)), "|a| [m/s²]")
    lines = [
        axes.line(*envelope(track.t, values), colour) for values, colour in zip(both, (BEFORE, AFTER), strict=True)
    ]
    lines.append(axes.level(track.gravity))
    label = "Magnitude of the acceleration over time, before and after"
    return axes.svg("magnitude-over-time", label, lines, ("before", BEFORE), ("after", AFTER), ("gravity", INK))


def innovations(track: Track) -> str:
    """Draw the innovations, measured minus predicted acceleration; empty if the filter cannot run."""
    e = track.innovations
    if e is None:
        return ""
    # larger ones are jerks
    most = 1.1 * float(np.quantile(np.abs(e), 0.995)) + 1e-6
    axes = _over_time(track, (-most, most), "innovation [m/s²]")
    bands = [axes.band(track.t[first], track.t[last - 1]) for first, last in track.runs]
    lines = [axes.line(*envelope(track.t[-len(e) :], e[:, i]), colour) for i, (_, colour) in enumerate(XYZ)]
    return axes.svg("innovations", "Innovations of the three axes over time", bands + lines, *XYZ, ("at rest", LINE))


def rates(track: Track) -> str:
    """Draw the rates of turn and the gyroscope's range; empty without a gyroscope."""
    if not np.isfinite(track.recording.gyr).all():
        return ""
    gyr, limit = np.degrees(track.recording.gyr), track.calibration.sensor.gyro_range_dps
    most = 1.1 * max(float(np.abs(gyr).max()), limit or 0.0) + 1e-6
    axes = _over_time(track, (-most, most), "rate [deg/s]")
    lines = [axes.line(*envelope(track.t, gyr[:, i]), colour) for i, (_, colour) in enumerate(XYZ)]
    lines += [] if limit is None else [axes.level(limit), axes.level(-limit)]
    return axes.svg("rates", "Rates of turn over time", lines, *XYZ, ("range", INK))


def temperature(track: Track) -> str:
    """Draw the sensor's temperature over time; empty if it is not known."""
    known = np.isfinite(track.recording.temperature_c)
    if known.sum() < 2:
        return ""
    t, values = envelope(track.t[known], track.recording.temperature_c[known])
    # a least span, so that a tenth of a degree does not look like a change
    middle, half = 0.5 * (values.min() + values.max()), max(0.55 * float(np.ptp(values)), 1.0)
    axes = _over_time(track, (middle - half, middle + half), "temperature [°C]")
    return axes.svg("temperature", "Temperature over time", [axes.line(t, values, AFTER)])


def envelope(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Return the least and greatest values of BINS stretches: few points that keep every spike."""
    if len(t) <= 2 * BINS:
        return t, values
    edges = np.linspace(0, len(t), BINS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    return np.repeat(t[edges], 2), np.column_stack([low, high]).ravel()


def _over_time(track: Track, y: tuple[float, float], y_label: str) -> Axes:
    return Axes((float(track.t[0]), float(track.t[-1])), y, _TIME, y_label)


def _span(values: Vector) -> tuple[float, float]:
    """Return the range of the values with a margin."""
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) + 1e-6
    return low - margin, high + margin
