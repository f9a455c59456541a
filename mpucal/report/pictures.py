"""The pictures over time: magnitudes, innovations, rates, temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Vector
from .figure import AFTER, BEFORE, INK, LINE, X, Y, Z, legend, over_time, svg
from .track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BINS = 500
# innovations beyond this share of them are jerks, which may lie outside the picture
_MOST = 0.995
_LEAST_SPAN_C = 1.0


def magnitude(track: Track) -> str:
    """|a| over time before and after: the paper's Fig. 2."""

    def draw(figure: Figure) -> None:
        axes = over_time(figure, track.t, "|a| [m/s²]")
        for acc, colour, name in ((track.recording.acc, BEFORE, "before"), (track.calibrated, AFTER, "after")):
            values = np.linalg.norm(acc, axis=1)
            axes.plot(*envelope(track.t, values), color=colour, linewidth=0.8, label=name)
        axes.axhline(track.gravity, color=INK, linewidth=0.8, linestyle="--", label="gravity")
        legend(figure)

    return svg(draw, "magnitude-over-time", "Magnitude of the acceleration over time, before and after", 2.4)


def innovations(track: Track) -> str:
    """The innovations: measured minus predicted acceleration; empty where the filter cannot run."""
    e = track.innovations
    if e is None:
        return ""

    def draw(figure: Figure) -> None:
        axes = over_time(figure, track.t, "innovation [m/s²]")
        for k, (first, last) in enumerate(track.runs):
            axes.axvspan(track.t[first], track.t[last - 1], color=LINE, linewidth=0, label=None if k else "at rest")
        for i, colour in enumerate((X, Y, Z)):
            axes.plot(*envelope(track.t[-len(e) :], e[:, i]), color=colour, linewidth=0.7, label="xyz"[i])
        most = 1.1 * float(np.quantile(np.abs(e), _MOST))
        axes.set_ylim(-most, most)
        legend(figure)

    return svg(draw, "innovations", "Innovations of the three axes over time", 2.4)


def rates(track: Track) -> str:
    """How fast the board was turned, and how fast the gyroscope can follow."""
    gyr, limit = np.degrees(track.recording.gyr), track.calibration.sensor.gyro_range_dps

    def draw(figure: Figure) -> None:
        axes = over_time(figure, track.t, "rate [deg/s]")
        for i, colour in enumerate((X, Y, Z)):
            axes.plot(*envelope(track.t, gyr[:, i]), color=colour, linewidth=0.7, label="xyz"[i])
        if limit is not None:
            axes.axhline(limit, color=INK, linewidth=0.8, linestyle="--", label="range")
            axes.axhline(-limit, color=INK, linewidth=0.8, linestyle="--")
        legend(figure)

    return svg(draw, "rates", "Rates of turn over time", 2.2)


def temperature(track: Track) -> str:
    """The sensor's temperature over time; empty where it is not known."""
    known = np.isfinite(track.recording.temperature_c)
    if known.sum() < 2:
        return ""
    t, values = envelope(track.t[known], track.recording.temperature_c[known])

    def draw(figure: Figure) -> None:
        axes = over_time(figure, track.t, "temperature [°C]")
        axes.plot(t, values, color=AFTER, linewidth=0.8)
        # a tenth of a degree shall not look like a change
        middle, half = 0.5 * (values.min() + values.max()), max(0.55 * float(np.ptp(values)), _LEAST_SPAN_C)
        axes.set_ylim(middle - half, middle + half)

    return svg(draw, "temperature", "Temperature over time", 1.8)


def envelope(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """The least and the greatest value of each of BINS stretches: few points, and no spike lost."""
    if len(t) <= 2 * BINS:
        return t, values
    edges = np.linspace(0, len(t), BINS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    return np.repeat(t[edges], 2), np.column_stack([low, high]).ravel()
