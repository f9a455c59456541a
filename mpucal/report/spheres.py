"""The pictures of directions: measurements beside the sphere of gravity, and the coverage of orientations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Vector
from .figure import AFTER, BEFORE, FAINT, INK, LINE, legend, svg
from .track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# where the sphere is looked at from; deviations are enlarged as long as they stay below this share of it
_FROM = (0.76, -0.54, 0.36)
_TIMES, _SHOWN = (20, 10, 5, 2, 1), 0.5
_FEWEST_RESTS, _MOST_LINES = 3, 60
_POINTS, _SPECKS = 300, 500
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 121)


def sphere(track: Track) -> str:
    """The measurements before and after, beside the sphere of gravity: the paper's Fig. 1."""
    both = [_points(track, acc) / track.gravity for acc in (track.recording.acc, track.calibrated)]
    farthest = max(float(np.abs(np.linalg.norm(points, axis=1) - 1.0).max()) for points in both)
    times = next((k for k in _TIMES if k * farthest <= _SHOWN), 1)

    def draw(figure: Figure) -> None:
        axes = _round(figure.subplots(), 1.0 + min(times * farthest, _SHOWN) + 0.05)
        view = _view()
        drawn: list[Vector] = []
        for k in range(3):
            circle = np.roll(np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE]), k, axis=1) @ view.T
            axes.plot(*np.where(circle[:, 2:] >= 0.0, circle, np.nan)[:, :2].T, color=LINE, linewidth=0.8)
        axes.plot(np.cos(_CIRCLE), np.sin(_CIRCLE), color=INK, linewidth=0.8)
        for points, colour, name in zip(both, (BEFORE, AFTER), ("before", "after"), strict=True):
            size = np.linalg.norm(points, axis=1, keepdims=True)
            seen = points / size * (1.0 + times * (size - 1.0)) @ view.T
            drawn.append(seen)
            front = seen[:, 2] >= 0.0
            near, far = seen[front], seen[~front]
            axes.scatter(near[:, 0], near[:, 1], s=16, color=colour, linewidths=0, label=name)
            axes.scatter(far[:, 0], far[:, 1], s=12, facecolors="none", edgecolors=colour, linewidths=0.7)
        for pair in np.stack(drawn, axis=1) if len(drawn[0]) <= _MOST_LINES else ():
            axes.plot(*pair[:, :2].T, color=FAINT, linewidth=0.5, zorder=0)
        axes.plot([], [], color=INK, linewidth=0.8, label="gravity")
        legend(figure)
        if times > 1:
            figure.supxlabel(f"distances from the sphere are drawn {times} times as large", color=FAINT, fontsize=7.5)

    return svg(draw, "sphere", f"Measurements before and after beside the sphere, deviations times {times}", 3.8)


def coverage(track: Track) -> str:
    """Which way was up in the board's axes: both halves of the sphere, in equal areas."""
    moving = _units(track.calibrated[:: max(len(track.calibrated) // _SPECKS, 1)])
    rests = _units(track.at_rest(track.calibrated))

    def draw(figure: Figure) -> None:
        for axes, sign, name in zip(figure.subplots(1, 2), (1.0, -1.0), ("z up", "z down"), strict=True):
            _round(axes, 1.25).set_title(name, fontsize=8.5)
            for radius, colour in ((1.0, INK), (float(np.sqrt(0.5)), LINE)):
                axes.plot(radius * np.cos(_CIRCLE), radius * np.sin(_CIRCLE), color=colour, linewidth=0.7)
            for at_x, at_y, text in ((1.12, 0.0, "x"), (-1.14, 0.0, "−x"), (0.0, 1.12, "y"), (0.0, -1.12, "−y")):
                axes.text(at_x, at_y, text, ha="center", va="center", color=FAINT)
            for units, colour, size in ((moving, FAINT, 1.5), (rests, AFTER, 22)):
                x, y = _flattened(units[sign * units[:, 2] >= 0.0]).T
                axes.scatter(x, y, s=size, color=colour, linewidths=0)

    return svg(draw, "coverage", "Which way was up in the board's axes: dots are rests, specks are turns", 2.5)


def _points(track: Track, acc: Vector) -> Vector:
    """(k, 3) m/s^2: the rests' means, or single samples where there are hardly any rests."""
    rests = track.at_rest(acc)
    return rests if len(rests) >= _FEWEST_RESTS else acc[:: max(len(acc) // _POINTS, 1)]


def _view() -> Vector:
    """(3, 3) right, up and towards the eye, as rows."""
    eye = np.array(_FROM) / np.linalg.norm(_FROM)
    right = np.cross((0.0, 0.0, 1.0), eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _flattened(units: Vector) -> Vector:
    """(k, 2) of unit vectors (k, 3) of one half of the sphere: Lambert's azimuthal projection, rim at 1."""
    return np.asarray(units[:, :2] / np.sqrt(1.0 + np.abs(units[:, 2:])))


def _units(acc: Vector) -> Vector:
    return np.asarray(acc / np.maximum(np.linalg.norm(acc, axis=1, keepdims=True), 1e-9))


def _round(axes: Axes, most: float) -> Axes:
    axes.set_axis_off()
    axes.set(aspect="equal", xlim=(-most, most), ylim=(-most, most))
    return axes
