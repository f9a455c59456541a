"""A calibration and a recording in a notebook: a table, and figures of matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from ..chip.families import Family, family_of
from ..data import AXES, Recording, Vector
from ..result.calibration import Calibration
from ..result.error_model import MG_PER_MPS2
from .data_sheet import tolerance
from .elements import paragraph, table
from .pictures import envelope
from .track import Track
from .units import ParameterRow, accelerometer, estimated_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT_IN = 4.5


def html(calibration: Calibration) -> str:
    """Return the verdict with its reasons, and a table of the accelerometer's parameters."""
    reasons = [str(reason["message"]) for reason in calibration.quality.get("reasons", ())]
    sentences = " ".join(
        filter(None, [f"{calibration.verdict}.", *(f"{r}." for r in reasons), estimated_error(calibration)])
    )
    rows = [[f"{row.name}, {row.unit}", *row.cells] for row in accelerometer(calibration)]
    caption = f"{calibration.sensor.chip or 'accelerometer'}: value ± 1 sigma"
    return paragraph(sentences) + table("mpucal", caption, ["", *AXES], rows)


def plot_calibration(calibration: Calibration, recording: Recording | None) -> Figure:
    """Plot the parameters and the data sheet; with a recording, |a| before and after and the innovations instead.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    return _parameters(calibration) if recording is None else _before_and_after(Track(recording, calibration))


def plot_recording(recording: Recording) -> Figure:
    """Plot accelerations and rates over time, and the flat part if known.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    figure = _figure(HEIGHT_IN)
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


def _figure(height_in: float) -> Figure:
    """Return an empty figure, which a notebook shows as a picture."""
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - only for a plot
    except ModuleNotFoundError as error:
        raise ImportError("figures need matplotlib: pip install 'mpucal[plot]'") from error
    figure = Figure(figsize=(8.0, height_in), layout="constrained")
    # IPython knows figures only if pyplot is imported
    vars(figure)["_repr_png_"] = partial(_png, figure)
    return figure


def _png(figure: Figure) -> bytes:
    file = BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _parameters(calibration: Calibration) -> Figure:
    """Plot scale factor errors, biases and misalignments with their standard uncertainties."""
    figure = _figure(HEIGHT_IN)
    sheet = family_of(calibration.sensor.chip)
    gain, bias, *angles = accelerometer(calibration)
    panels = figure.subplots(1, 3, width_ratios=(1, 1, 2))
    for axes, rows in zip(panels, ([gain], [bias], angles), strict=True):
        _values(axes, rows, sheet)
    return figure


def _values(axes: Axes, rows: Sequence[ParameterRow], sheet: Family | None) -> None:
    """Plot rows of one unit over the tolerance of the data sheet."""
    which = [(row, i) for row in rows for i in range(3) if AXES[i] in row.axes]
    # A misalignment is named by both of its axes.
    x = [f"{AXES[i]} to {row.name[-1]}" if len(rows) > 1 else AXES[i] for row, i in which]
    if sheet is not None:
        allowed = np.array([tolerance(row, sheet)[i] for row, i in which])
        axes.bar(x, 2.0 * allowed, bottom=-allowed, color="0.9", label="data sheet")
        if len(rows) > 1:
            axes.legend()
    axes.axhline(0.0, color="black", linewidth=0.8)
    values, std = ([getattr(row, of)[i] for row, i in which] for of in ("value", "std"))
    axes.errorbar(x, values, std, fmt="o", capsize=4.0)
    axes.set_title(f"{rows[0].name.partition(' to ')[0]} [{rows[0].unit}]")


def _before_and_after(track: Track) -> Figure:
    figure = _figure(2.0 * HEIGHT_IN)
    magnitude, rests, innovations = figure.subplots(3)
    for name, acc in (("before", track.recording.acc), ("after", track.calibrated)):
        magnitude.plot(*envelope(track.t, np.linalg.norm(acc, axis=1)), linewidth=0.8, label=name)
        error = np.linalg.norm(track.at_rest(acc), axis=1) - track.gravity
        rests.plot(np.arange(1, len(error) + 1), MG_PER_MPS2 * error, "o", label=name)
    magnitude.axhline(track.gravity, color="black", linewidth=0.8, linestyle="--", label="gravity")
    magnitude.set(xlabel="time [s]", ylabel="|a| [m/s²]")
    rests.axhline(0.0, color="black", linewidth=0.8)
    rests.set(xlabel="rest", ylabel="|a| − gravity [mg]")
    e = track.innovations
    if e is not None:
        _lines(innovations, track.t[-len(e) :], e, "innovation [m/s²]")
        innovations.legend()
    innovations.set_xlabel("time [s]")
    magnitude.legend()
    return figure


def _lines(axes: Axes, t: Vector, values: Vector, label: str) -> None:
    for i, name in enumerate(AXES):
        axes.plot(*envelope(t, values[:, i]), linewidth=0.8, label=name)
    axes.set_ylabel(label)
