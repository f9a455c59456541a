"""The pictures of a recording with their captions: rests, magnitudes, innovations, rates and temperature over time.

The pictures of directions are measurements beside the sphere of gravity, and the coverage of orientations.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..calibration.rotation import units
from ..data import Vector
from ..origin import name_thing
from ..result.error_model import MG_PER_MPS2
from .elements import figure
from .figure import AFTER, BEFORE, FAINT, HEIGHT, INK, LINE, WIDTH, XYZ, Axes, dots, legend, line, svg, text
from .track import Track

# stretches of a curve, and dots of a moving board
POINTS = 500
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
    fastest_dps = float(np.degrees(np.abs(track.recording.gyr).max()))
    drawn = {
        "residuals": (residuals(track), RESIDUALS),
        "magnitude": (magnitude(track), MAGNITUDE),
        "sphere": (sphere(track), SPHERE),
        "innovations": (innovations(track), _about_innovations(track)),
        "coverage": (coverage(track), COVERAGE),
        "rates": (rates(track), f"Fastest: {fastest_dps:.0f} deg/s. Rates beyond the range are clipped."),
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
    """Return the least and greatest values of POINTS stretches: few points that keep every spike."""
    if len(t) <= 2 * POINTS:
        return t, values
    edges = np.linspace(0, len(t), POINTS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    return np.repeat(t[edges], 2), np.column_stack([low, high]).ravel()


def _over_time(track: Track, y: tuple[float, float], y_label: str) -> Axes:
    return Axes((float(track.t[0]), float(track.t[-1])), y, _TIME, y_label)


def _span(values: Vector) -> tuple[float, float]:
    """Return the range of the values with a margin."""
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) + 1e-6
    return low - margin, high + margin


# viewpoint of the sphere, that of the page's ball; the largest share of the radius to which deviations are enlarged
_VIEWPOINT = (0.302, -0.830, -0.469)
_MOST_DEVIATION = 0.5
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 121)
_UNIT_CIRCLE = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
_HEIGHT = 340.0


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
    times = next((k for k in (20, 10, 5, 2) if k * farthest <= _MOST_DEVIATION), 1)
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
    if len(drawn[0]) <= 60:
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
    moving = -units(track.calibrated[:: max(len(track.calibrated) // POINTS, 1)])
    rests = -units(track.at_rest(track.calibrated))
    marks = []
    for centre, sign, name in ((0.25, -1.0, "+Z up"), (0.75, 1.0, "−Z up")):
        disc = _Disc(centre * WIDTH, HEIGHT / 2.0 + 8.0, 84.0)
        marks += [line(*disc.place(radius * _UNIT_CIRCLE), colour) for radius, colour in ((1.0, INK), (0.5**0.5, LINE))]
        marks.append(text(centre * WIDTH, 12.0, name))
        for at_x, at_y, letter in ((1.13, -0.04, "+X"), (-1.13, -0.04, "−X"), (0.0, 1.05, "+Y"), (0.0, -1.14, "−Y")):
            (x,), (y,) = disc.place(np.array([[at_x, at_y]]))
            marks.append(text(float(x), float(y), letter, colour=FAINT))
        for shown, colour, radius in ((moving, FAINT, 0.8), (rests, AFTER, 3.2)):
            marks.append(dots(*disc.place(_project(shown[sign * shown[:, 2] >= 0.0])), radius, colour))
    label = "Direction that pointed down, in the axes of x, y and z: large dots held still, small dots moving"
    return svg("coverage", label, HEIGHT, *marks)


def _points(track: Track, acc: Vector) -> Vector:
    """Return (k, 3) m/s^2: the means of rests, or single samples if there are hardly any rests."""
    rests = track.at_rest(acc)
    return rests if len(rests) >= 3 else acc[:: max(len(acc) // POINTS, 1)]


def _view() -> Vector:
    """Return (3, 3): the directions right, up and towards the viewer, as rows."""
    eye = np.array(_VIEWPOINT) / np.linalg.norm(_VIEWPOINT)
    right = np.cross((0.0, 0.0, 1.0), eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _project(units: Vector) -> Vector:
    """Project unit vectors (k, 3) of a hemisphere to (k, 2) by Lambert's azimuthal projection, rim at 1."""
    return np.asarray(units[:, :2] / np.sqrt(1.0 + np.abs(units[:, 2:])))
