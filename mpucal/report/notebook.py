"""A calibration and a recording in a notebook: a table, and figures of matplotlib in its own colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Recording, Vector
from ..result.calibration import Calibration
from .elements import paragraph, table
from .pictures import envelope
from .track import Track
from .units import AXES, accelerometer, estimated_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE_IN = (8.0, 4.5)


def html(calibration: Calibration) -> str:
    """The verdict with its reasons, and the accelerometer's parameters with their standard uncertainties."""
    reasons = [str(reason["message"]) for reason in calibration.quality.get("reasons", ())]
    said = " ".join(
        filter(None, [f"{calibration.verdict}.", *(f"{r}." for r in reasons), estimated_error(calibration)])
    )
    rows = [[f"{row.name}, {row.unit}", *row.cells] for row in accelerometer(calibration)]
    caption = f"{calibration.sensor.chip or 'accelerometer'}: value ± 1 sigma"
    return paragraph(said) + table("mpucal", caption, ["", *AXES], rows)


def plot_calibration(calibration: Calibration, recording: Recording) -> Figure:
    """|a| of a recording over time, before and after.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where something is drawn

    track = Track(recording, calibration)
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.subplots()
    for name, acc in (("before", recording.acc), ("after", track.calibrated)):
        axes.plot(*envelope(track.t, np.linalg.norm(acc, axis=1)), linewidth=0.8, label=name)
    axes.axhline(track.gravity, color="black", linewidth=0.8, linestyle="--", label="gravity")
    axes.set(xlabel="time [s]", ylabel="|a| [m/s²]")
    axes.legend()
    return figure


def plot_recording(recording: Recording) -> Figure:
    """Accelerations and rates over time, and the flat part, where it is known.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where something is drawn

    figure = Figure(figsize=SIZE_IN, layout="constrained")
    upper, lower = figure.subplots(2, sharex=True)
    t = np.asarray(recording.t - recording.t[0])
    _lines(upper, t, recording.acc, "acceleration [m/s²]")
    _lines(lower, t, np.degrees(recording.gyr), "rate [deg/s]")
    lower.set_xlabel("time [s]")
    if recording.flat is not None:
        for axes in (upper, lower):
            axes.axvspan(t[recording.flat[0]], t[recording.flat[1] - 1], alpha=0.2, label="flat")
    upper.legend()
    return figure


def _lines(axes: Axes, t: Vector, values: Vector, label: str) -> None:
    for i, name in enumerate(AXES):
        axes.plot(*envelope(t, values[:, i]), linewidth=0.8, label=name)
    axes.set_ylabel(label)
