"""The pictures over time: the rests before and after, magnitudes, innovations, rates, temperature."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from ..result.error_model import MG_PER_MPS2
from .figure import AFTER, BEFORE, INK, LINE, Axes, X, Y, Z, dots, legend, svg
from .track import Track

BINS = 500
HEIGHT = 210.0
# innovations beyond this share of them are jerks, which may lie outside the picture
_MOST = 0.995
_LEAST_SPAN_C = 1.0
_TIME = "time [s]"
_XYZ = (("x", X), ("y", Y), ("z", Z))


def residuals(track: Track) -> str:
    """|a| - g of each rest before and after; empty where there are none."""
    if not len(track.runs):
        return ""
    both = [
        MG_PER_MPS2 * (np.linalg.norm(track.at_rest(acc), axis=1) - track.gravity)
        for acc in (track.recording.acc, track.calibrated)
    ]
    most = 1.1 * max(float(np.abs(values).max()) for values in both) + 1e-3
    number = np.arange(1.0, len(track.runs) + 1.0)
    axes = Axes(HEIGHT, (0.5, len(number) + 0.5), (-most, most), "rest", "|a| − gravity [mg]")
    marks = [dots(*axes.place(number, v), 3.0, colour) for v, colour in zip(both, (BEFORE, AFTER), strict=True)]
    named = legend(("before", BEFORE), ("after", AFTER))
    return svg("residuals", "|a| minus gravity at each rest", HEIGHT, axes.level(0.0), *marks, axes.frame(), named)


def magnitude(track: Track) -> str:
    """|a| over time before and after: the paper's Fig. 2."""
    both = [np.linalg.norm(acc, axis=1) for acc in (track.recording.acc, track.calibrated)]
    axes = _over_time(track, _span(np.concatenate(both)), "|a| [m/s²]")
    lines = [
        axes.line(*envelope(track.t, values), colour) for values, colour in zip(both, (BEFORE, AFTER), strict=True)
    ]
    named = legend(("before", BEFORE), ("after", AFTER), ("gravity", INK))
    label = "Magnitude of the acceleration over time, before and after"
    return svg("magnitude-over-time", label, HEIGHT, *lines, axes.level(track.gravity), axes.frame(), named)


def innovations(track: Track) -> str:
    """The innovations: measured minus predicted acceleration; empty where the filter cannot run."""
    e = track.innovations
    if e is None:
        return ""
    most = 1.1 * float(np.quantile(np.abs(e), _MOST)) + 1e-6
    axes = _over_time(track, (-most, most), "innovation [m/s²]")
    bands = [axes.band(track.t[first], track.t[last - 1]) for first, last in track.runs]
    lines = [axes.line(*envelope(track.t[-len(e) :], e[:, i]), colour) for i, (_, colour) in enumerate(_XYZ)]
    named = legend(*_XYZ, ("at rest", LINE))
    return svg("innovations", "Innovations of the three axes over time", HEIGHT, *bands, *lines, axes.frame(), named)


def rates(track: Track) -> str:
    """How fast the board was turned, and how fast the gyroscope can follow."""
    gyr, limit = np.degrees(track.recording.gyr), track.calibration.sensor.gyro_range_dps
    most = 1.1 * max(float(np.abs(gyr).max()), limit or 0.0) + 1e-6
    axes = _over_time(track, (-most, most), "rate [deg/s]")
    lines = [axes.line(*envelope(track.t, gyr[:, i]), colour) for i, (_, colour) in enumerate(_XYZ)]
    lines += [] if limit is None else [axes.level(limit), axes.level(-limit)]
    return svg("rates", "Rates of turn over time", HEIGHT, *lines, axes.frame(), legend(*_XYZ, ("range", INK)))


def temperature(track: Track) -> str:
    """The sensor's temperature over time; empty where it is not known."""
    known = np.isfinite(track.recording.temperature_c)
    if known.sum() < 2:
        return ""
    t, values = envelope(track.t[known], track.recording.temperature_c[known])
    # a tenth of a degree shall not look like a change
    middle, half = 0.5 * (values.min() + values.max()), max(0.55 * float(np.ptp(values)), _LEAST_SPAN_C)
    axes = _over_time(track, (middle - half, middle + half), "temperature [°C]")
    return svg("temperature", "Temperature over time", HEIGHT, axes.line(t, values, AFTER), axes.frame())


def envelope(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """The least and the greatest value of each of BINS stretches: few points, and no spike lost."""
    if len(t) <= 2 * BINS:
        return t, values
    edges = np.linspace(0, len(t), BINS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    return np.repeat(t[edges], 2), np.column_stack([low, high]).ravel()


def _over_time(track: Track, y: tuple[float, float], y_label: str) -> Axes:
    return Axes(HEIGHT, (float(track.t[0]), float(track.t[-1])), y, _TIME, y_label)


def _span(values: Vector) -> tuple[float, float]:
    """A little more than from the least to the greatest."""
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) + 1e-6
    return low - margin, high + margin
