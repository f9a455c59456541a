"""Figures of matplotlib as SVG elements that take their colours from the page."""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape
from io import StringIO
from typing import TYPE_CHECKING, Any

from ..data import Vector

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# as wide as it can be read at on a phone, where the page shrinks it by a fifth
WIDTH_IN = 4.4
# colours nobody else draws with -> the page's own, which change with the reader's light
_PAGE = {f"#0000{k:02x}": name for k, name in enumerate(("ink", "before", "after", "faint", "line", "x", "y", "z"), 1)}
INK, BEFORE, AFTER, FAINT, LINE, X, Y, Z = _PAGE
_SETTINGS: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "mpucal",
    "font.size": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}


def svg(draw: Callable[[Figure], None], name: str, label: str, height_in: float) -> str:
    """What `draw` draws, as an `svg` element.

    Parameters
    ----------
    name : of the picture, unlike any other on the page. label : what it shows, for who cannot see it.

    Raises
    ------
    ImportError : matplotlib is not installed.
    """
    # Figure and not pyplot: no window, no state that outlives this call
    from matplotlib import rc_context  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    with rc_context(_SETTINGS):
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        draw(figure)
        text = StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return _for_the_page(text.getvalue(), name, label)


def over_time(figure: Figure, t: Vector, y_label: str) -> Axes:
    """Axes for values over the time t (n,) [s]."""
    axes = figure.subplots()
    axes.set(xlabel="time [s]", ylabel=y_label, xlim=(float(t[0]), float(t[-1])))
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def legend(figure: Figure) -> None:
    """What the lines are, in a row above them."""
    figure.legend(frameon=False, ncols=4, loc="outside upper right", handlelength=1.2, columnspacing=1.2)


def _for_the_page(text: str, name: str, label: str) -> str:
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # matplotlib counts anew in each picture, and speaks in its style sheet of the whole page
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
    for colour, variable in _PAGE.items():
        text = text.replace(colour, f"var(--{variable})")
    return text.replace("<svg", f'<svg id="{name}" role="img" aria-label="{escape(label)}"', 1)
