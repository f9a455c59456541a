"""Pictures as SVG in the page's colours: marks, and axes for values over time."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..data import Vector
from .elements import escape

# px, of axes; the page scales a picture to its column
WIDTH, HEIGHT = 420.0, 210.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 48.0, 6.0, 24.0, 32.0
# the page's colours, which differ in light and dark mode
INK, BEFORE, AFTER, FAINT, LINE, X, Y, Z = (
    f"var(--{name})" for name in ("ink", "before", "after", "faint", "line", "x", "y", "z")
)


def svg(name: str, label: str, height: float, *marks: str) -> str:
    """Return an `svg` element; `name` is its id, `label` its text for screen readers."""
    head = f'<svg id="{name}" role="img" aria-label="{escape(label)}" viewBox="0 0 {WIDTH:g} {height:g}"'
    return f'{head} font-size="11" fill="{INK}">{"".join(marks)}</svg>'


def line(x: Vector, y: Vector, colour: str, width: float = 1.0, dashed: bool = False) -> str:
    """Return a line through the points [px], interrupted at NaN."""
    known = ~(np.isnan(x) | np.isnan(y))
    places = np.column_stack((x, y))
    path = ""
    for first, last in np.flatnonzero(np.diff(known, prepend=False, append=False)).reshape(-1, 2).tolist():
        # One format for all points takes 0.6 of the time of one for each.
        path += "M" + "L".join(["%.1f %.1f"] * (last - first)) % tuple(places[first:last].ravel().tolist())
    dashes = ' stroke-dasharray="4 3"' if dashed else ""
    return f'<path d="{path}" style="fill: none; stroke: {colour}" stroke-width="{width:g}"{dashes}/>'


def dots(x: Vector, y: Vector, radius: float, colour: str, hollow: bool = False) -> str:
    """Return a dot at each of the points [px]."""
    style = f"fill: none; stroke: {colour}" if hollow else f"fill: {colour}"
    circles = "".join(f'<circle cx="{i:.1f}" cy="{j:.1f}" r="{radius:g}"/>' for i, j in zip(x, y, strict=True))
    return f'<g style="{style}">{circles}</g>'


def text(x: float, y: float, words: str, anchor: str = "middle", colour: str = INK) -> str:
    """Return text at a point [px]; `anchor` is start, middle or end."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" style="fill: {colour}">{escape(words)}</text>'


def legend(*entries: tuple[str, str]) -> str:
    """Return a legend of (words, colour) entries, aligned to the right."""
    marks, right = [], WIDTH - _RIGHT
    for words, colour in reversed(entries):
        marks.append(text(right, 12.0, words, "end"))
        right -= 6.2 * len(words) + 6.0
        marks.append(line(np.array([right - 14.0, right]), np.array([8.0, 8.0]), colour, 3.0))
        right -= 26.0
    return "".join(marks)


# names and colours of the axes, as a legend
XYZ = (("x", X), ("y", Y), ("z", Z))


class Axes:
    """Axes over the ranges `x` and `y` (least, greatest); values beyond `y` are drawn at its edge."""

    def __init__(self, x: tuple[float, float], y: tuple[float, float], x_label: str, y_label: str) -> None:
        self._x, self._y = x, y
        self._labels = x_label, y_label

    def place(self, x: Vector, y: Vector) -> tuple[Vector, Vector]:
        """Return the positions of values in the picture [px]."""
        (left, right), (low, high) = self._x, self._y
        across, up = (x - left) / (right - left), (np.clip(y, low, high) - low) / (high - low)
        return _LEFT + across * (WIDTH - _LEFT - _RIGHT), HEIGHT - _BOTTOM - up * (HEIGHT - _BOTTOM - _TOP)

    def line(self, x: Vector, y: Vector, colour: str, width: float = 1.0) -> str:
        """Return a line through values."""
        return line(*self.place(x, y), colour, width)

    def level(self, y: float) -> str:
        """Return a dashed horizontal line at a value."""
        return line(*self.place(np.array(self._x), np.array([y, y])), INK, dashed=True)

    def band(self, first: float, last: float) -> str:
        """Return a shaded range of x."""
        (left, right), _ = self.place(np.array([first, last]), np.array(self._y))
        size = f'width="{right - left:.1f}" height="{HEIGHT - _BOTTOM - _TOP:g}"'
        return f'<rect x="{left:.1f}" y="{_TOP:g}" {size} style="fill: {LINE}"/>'

    def svg(self, name: str, label: str, marks: Iterable[str], *entries: tuple[str, str]) -> str:
        """Return the picture of the marks behind the axes, with a legend of (words, colour) entries; see svg."""
        return svg(name, label, HEIGHT, *marks, self._frame(), legend(*entries))

    def _frame(self) -> str:
        """Return the axes with their numbers and labels."""
        (left, right), (bottom, top) = self.place(np.array(self._x), np.array(self._y))
        marks = [line(np.array([left, left, right]), np.array([top, bottom, bottom]), INK)]
        for value, label in ticks(*self._x):
            (x, *_), _y = self.place(np.array([value]), np.array([0.0]))
            marks.append(text(x, bottom + 13.0, label))
        for value, label in ticks(*self._y):
            _x, (y, *_) = self.place(np.array([0.0]), np.array([value]))
            marks.append(text(left - 5.0, y + 4.0, label, "end"))
            marks.append(line(np.array([left - 3.0, left]), np.array([y, y]), INK))
        x_label, y_label = self._labels
        return "".join(marks) + text(right, HEIGHT - 4.0, x_label, "end") + text(2.0, 12.0, y_label, "start")


def ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return at least four round numbers within (low, high) with their text."""
    power = math.floor(math.log10(high - low))
    step = next(
        step
        for exponent in (power, power - 1)
        for step in (k * 10.0**exponent for k in (10.0, 5.0, 2.0, 1.0))
        if (high - low) / step >= 4
    )
    digits = max(0, -math.floor(math.log10(step)))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [(k * step, f"{k * step:.{digits}f}".replace("-", "−")) for k in range(first, last + 1)]
