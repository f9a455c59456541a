"""The picture of |a| before and after, as SVG that takes its colours from the page. Knows no verdict."""

from __future__ import annotations

import re
from io import StringIO

import numpy as np

from ..data import Vector

BINS = 500
# colours nobody else draws with -> the page's own, which change with the reader's light
_COLOURS = {"#000001": "--ink", "#000002": "--before", "#000003": "--after", "#000004": "--faint"}
_INK, _BEFORE, _AFTER, _FAINT = _COLOURS
_LABEL = "Magnitude of the acceleration over time, before and after the calibration"


def magnitude_svg(t: Vector, before: Vector, after: Vector, gravity: float) -> str:
    """|a| over time as an `svg` element.

    Parameters
    ----------
    t : (n,) s. before, after : (n,) m/s^2. gravity : m/s^2, drawn as a line where it is known.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    # Figure and not pyplot: no window, no state that outlives this call
    from matplotlib import rc_context  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    with rc_context(
        {
            "svg.fonttype": "none",
            "svg.hashsalt": "mpucal",
            "font.size": 9,
            "axes.labelcolor": _INK,
            "axes.edgecolor": _INK,
            "text.color": _INK,
            "xtick.color": _INK,
            "ytick.color": _INK,
        }
    ):
        figure = Figure(figsize=(8.0, 3.0), layout="constrained")
        axes = figure.subplots()
        for values, colour, label in ((before, _BEFORE, "before"), (after, _AFTER, "after")):
            axes.plot(*_envelope(t - t[0], values), color=colour, linewidth=0.8, label=label)
        if np.isfinite(gravity):
            axes.axhline(gravity, color=_FAINT, linewidth=0.8, linestyle="--", label="gravity")
        axes.set(xlabel="time [s]", ylabel="|a| [m/s²]", xmargin=0)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(frameon=False, ncols=3, loc="outside upper right")
        text = StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return _for_the_page(text.getvalue())


def _envelope(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """The least and the greatest value of each of BINS stretches: few points, and no spike lost."""
    if len(t) <= 2 * BINS:
        return t, values
    edges = np.linspace(0, len(t), BINS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    return np.repeat(t[edges], 2), np.column_stack([low, high]).ravel()


def _for_the_page(svg: str) -> str:
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    for colour, name in _COLOURS.items():
        svg = svg.replace(colour, f"var({name})")
    return svg.replace("<svg", f'<svg role="img" aria-label="{_LABEL}"', 1)
