"""The pictures of directions: measurements and the sphere of gravity, and the coverage of orientations."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from .figure import AFTER, BEFORE, FAINT, INK, LINE, WIDTH, dots, legend, line, svg, text
from .track import Track

# viewpoint of the sphere, that of the page's ball; enlargements of deviations, and their largest share of the radius
_VIEWPOINT = (0.302, -0.830, -0.469)
_ENLARGEMENTS, _MOST_DEVIATION = (20, 10, 5, 2, 1), 0.5
_FEWEST_RESTS, _MOST_LINES = 3, 60
_MOVING_DOTS = 500
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 121)
_UNIT_CIRCLE = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
_HEIGHT, _COVERAGE_HEIGHT = 340.0, 230.0


class _Disc:
    """Part of the picture about a centre [px], where 1 is `unit` px and y points up."""

    def __init__(self, x: float, y: float, unit: float) -> None:
        self._centre, self._unit = np.array([x, y]), unit

    def place(self, points: Vector) -> tuple[Vector, Vector]:
        """Return the positions in the picture [px] of points (n, 2) or more columns."""
        x, y = (self._centre + self._unit * points[:, :2] * (1.0, -1.0)).T
        return x, y


def sphere(track: Track) -> str:
    """Draw the measurements before and after, as directions that point down, with the sphere of gravity.

    Compare the paper's Fig. 1; the screen and the page show the same directions.
    """
    both = [-_points(track, acc) / track.gravity for acc in (track.recording.acc, track.calibrated)]
    farthest = max(float(np.abs(np.linalg.norm(points, axis=1) - 1.0).max()) for points in both)
    times = next((k for k in _ENLARGEMENTS if k * farthest <= _MOST_DEVIATION), 1)
    disc = _Disc(WIDTH / 2.0, _HEIGHT / 2.0 + 4.0, 145.0 / (1.0 + min(times * farthest, _MOST_DEVIATION)))
    view = _view()
    marks = []
    for k in range(3):
        circle = np.roll(np.column_stack([_UNIT_CIRCLE, 0.0 * _CIRCLE]), k, axis=1) @ view.T
        marks.append(line(*disc.place(np.where(circle[:, 2:] >= 0.0, circle, np.nan)), LINE))
    marks.append(line(*disc.place(_UNIT_CIRCLE), INK))
    for axis, letter in zip(np.vstack([np.eye(3), -np.eye(3)]), ("+X", "+Y", "+Z", "−X", "−Y", "−Z"), strict=True):
        seen = view @ axis
        if seen[2] >= 0.0:
            (x,), (y,) = disc.place(seen[None])
            marks.append(text(float(x), float(y) + 16.0, letter, colour=FAINT))
    drawn = []
    for points in both:
        size = np.linalg.norm(points, axis=1, keepdims=True)
        drawn.append(points / size * (1.0 + times * (size - 1.0)) @ view.T)
    if len(drawn[0]) <= _MOST_LINES:
        marks += [line(*disc.place(pair), FAINT, 0.5) for pair in np.stack(drawn, axis=1)]
    for seen, colour in zip(drawn, (BEFORE, AFTER), strict=True):
        front = seen[:, 2] >= 0.0
        marks.append(dots(*disc.place(seen[front]), 3.0, colour))
        marks.append(dots(*disc.place(seen[~front]), 2.6, colour, hollow=True))
    marks.append(legend(("before", BEFORE), ("after", AFTER), ("gravity", INK)))
    if times > 1:
        note = f"distances from the sphere are enlarged {times} times"
        marks.append(text(WIDTH / 2.0, _HEIGHT - 4.0, note, colour=FAINT))
    return svg("sphere", f"Measurements before and after beside the sphere, deviations times {times}", _HEIGHT, *marks)


def coverage(track: Track) -> str:
    """Draw the directions that pointed down in the board's axes, on both halves of the sphere, in equal areas."""
    moving = -_units(track.calibrated[:: max(len(track.calibrated) // _MOVING_DOTS, 1)])
    rests = -_units(track.at_rest(track.calibrated))
    marks = []
    for centre, sign, name in ((0.25, -1.0, "+Z up"), (0.75, 1.0, "−Z up")):
        disc = _Disc(centre * WIDTH, _COVERAGE_HEIGHT / 2.0 + 8.0, 84.0)
        marks += [line(*disc.place(radius * _UNIT_CIRCLE), colour) for radius, colour in ((1.0, INK), (0.5**0.5, LINE))]
        marks.append(text(centre * WIDTH, 12.0, name))
        for at_x, at_y, letter in ((1.13, -0.04, "+X"), (-1.13, -0.04, "−X"), (0.0, 1.05, "+Y"), (0.0, -1.14, "−Y")):
            (x,), (y,) = disc.place(np.array([[at_x, at_y]]))
            marks.append(text(float(x), float(y), letter, colour=FAINT))
        for units, colour, radius in ((moving, FAINT, 0.8), (rests, AFTER, 3.2)):
            marks.append(dots(*disc.place(_project(units[sign * units[:, 2] >= 0.0])), radius, colour))
    label = "Direction that pointed down, in the axes of x, y and z: large dots held still, small dots moving"
    return svg("coverage", label, _COVERAGE_HEIGHT, *marks)


def _points(track: Track, acc: Vector) -> Vector:
    """Return (k, 3) m/s^2: the means of rests, or single samples if there are hardly any rests."""
    rests = track.at_rest(acc)
    return rests if len(rests) >= _FEWEST_RESTS else acc[:: max(len(acc) // _MOVING_DOTS, 1)]


def _view() -> Vector:
    """Return (3, 3): the directions right, up and towards the viewer, as rows."""
    eye = np.array(_VIEWPOINT) / np.linalg.norm(_VIEWPOINT)
    right = np.cross((0.0, 0.0, 1.0), eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _project(units: Vector) -> Vector:
    """Project unit vectors (k, 3) of a hemisphere to (k, 2) by Lambert's azimuthal projection, rim at 1."""
    return np.asarray(units[:, :2] / np.sqrt(1.0 + np.abs(units[:, 2:])))


def _units(acc: Vector) -> Vector:
    return np.asarray(acc / np.maximum(np.linalg.norm(acc, axis=1, keepdims=True), 1e-9))
