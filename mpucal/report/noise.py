"""The noise of a sensor as text and as an HTML page: coefficients, Allan deviation, slow course."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .. import __version__
from ..result.clock import duration
from ..result.error_model import MG_PER_MPS2
from ..result.noise import ACCELEROMETER, GYROSCOPE, INSTABILITY, QUANTISATION, WALK, WHITE, Noise, axes_of
from .elements import document, figure, paragraph, section, table
from .figure import INK, XYZ, Axes

SENSORS = (ACCELEROMETER, GYROSCOPE)
# sensor -> coefficient -> (factor, unit) of the text
UNITS = {
    ACCELEROMETER: {
        WHITE: (1e3 * MG_PER_MPS2, "ug/√Hz"),
        INSTABILITY: (1e3 * MG_PER_MPS2, "ug"),
        WALK: (1e3 * MG_PER_MPS2, "ug/√s"),
        QUANTISATION: (1e3 * MG_PER_MPS2, "ug s"),
    },
    GYROSCOPE: {
        WHITE: (math.degrees(1.0), "deg/s/√Hz"),
        INSTABILITY: (math.degrees(3600.0), "deg/h"),
        WALK: (math.degrees(3600.0), "deg/h/√s"),
        QUANTISATION: (math.degrees(3600.0), "deg/h s"),
    },
}


def rows(noise: Noise, sensor: str) -> Iterator[tuple[str, list[str]]]:
    """Yield name with unit, and the values of x, y, z with 95 % intervals, of each coefficient of a sensor."""
    part = axes_of(sensor)
    for name, (factor, unit) in UNITS[sensor].items():
        cells = [
            _cell(*(float(factor * end[name][part][axis]) for end in (noise.values, noise.low, noise.high)))
            for axis in range(3)
        ]
        yield f"{name.replace('_', ' ')}, {unit}", cells


def summary(noise: Noise) -> str:
    """Return the text that `mpucal noise` prints."""
    lines = [f"! {row['message']}." for row in noise.suspicious]
    lines += [""] if lines else []
    for sensor in SENSORS:
        lines += [f"{sensor:<32}" + "".join(f"{axis:>31}" for axis in "xyz")]
        lines += [f"  {name:<30}" + "".join(f"{cell:>31}" for cell in cells) for name, cells in rows(noise, sensor)]
        comparison = _data_sheet(noise, sensor)
        lines += [f"  {comparison}", ""] if comparison else [""]
    lines.append(f"{noise.samples} samples at {noise.rate_hz:.1f} Hz in {duration(noise.seconds)}. In brackets: 95 %.")
    return "\n".join(lines)


def render(noise: Noise) -> str:
    """Return the page."""
    head = ("", *"xyz")
    tables = [
        table(sensor, sensor, head, [(name, *cells) for name, cells in rows(noise, sensor)])
        + (paragraph(sheet, note=True) if (sheet := _data_sheet(noise, sensor)) else "")
        for sensor in SENSORS
    ]
    pictures = [_allan(noise, sensor) for sensor in SENSORS]
    course = _course(noise) if len(noise.course) > 1 else ""
    beside = ", and the data sheet's white noise" if noise.data_sheet else ""
    caption = f"Overlapping Allan deviation; thin lines: 95 % interval{beside}."
    suspicious = "".join(paragraph(f"{row['message']}.") for row in noise.suspicious)
    about = f"{noise.samples} samples at {noise.rate_hz:.1f} Hz in {duration(noise.seconds)}."
    name = noise.sensor.chip or "a sensor"
    body = (
        section("Suspicious", suspicious),
        section("Coefficients", *tables, paragraph("In brackets: 95 % intervals.", note=True)),
        section("Allan deviation", *(figure(picture, caption) for picture in pictures)),
        section("Over time", figure(course, "Means over blocks, each axis minus its mean, in standard deviations.")),
    )
    made = paragraph(f"mpucal {__version__}, {noise.created}", note=True)
    return document(f"Noise of {name}", f"Noise of {name}", paragraph(about), *body, made)


def _allan(noise: Noise, sensor: str) -> str:
    part = axes_of(sensor)
    factor, unit = UNITS[sensor][INSTABILITY]
    tau, deviations = np.log10(noise.tau_s), np.log10(np.maximum(factor * noise.deviations[:, part], 1e-300))
    share = np.log10(1.0 + 1.96 / np.sqrt(2.0 * np.maximum(noise.clusters, 1.0)))
    low, high = float((deviations.min(1) - share).min()), float((deviations.max(1) + share).max())
    labels = "log10 τ [s]", f"log10 of {sensor} [{unit}]"
    axes = Axes((float(tau[0]), float(tau[-1])), (low, high), *labels)
    marks = []
    for deviation, (_, colour) in zip(deviations.T, XYZ, strict=True):
        marks += [axes.line(tau, deviation, colour, 1.6)]
        marks += [axes.line(tau, deviation + sign * share, colour, 0.5) for sign in (-1.0, 1.0)]
    named = [*XYZ]
    if sensor in noise.data_sheet:
        marks.append(axes.line(tau, np.log10(factor * noise.data_sheet[sensor]) - 0.5 * tau, INK, 0.8))
        named.append(("data sheet", INK))
    return axes.svg(f"allan-{sensor}", f"Allan deviation of the {sensor}", marks, *named)


def _course(noise: Noise) -> str:
    spread = np.maximum(noise.course[:, :6].std(0), 1e-300)
    scaled = (noise.course[:, :6] - noise.course[:, :6].mean(0)) / spread - 8.0 * np.arange(6)
    axes = Axes((0.0, float(noise.course_s[-1])), (-45.0, 5.0), "time [s]", "six axes")
    lines = [axes.line(noise.course_s, of, colour) for of, (_, colour) in zip(scaled.T, XYZ * 2, strict=True)]
    return axes.svg("course", "Slow course of the six axes", lines, *XYZ)


def _cell(value: float, low: float, high: float) -> str:
    if not math.isfinite(value):
        return "not observable"
    return f"{value:.3g} [{low:.3g}, {high:.3g}]" if low > 0.0 else f"below {high:.3g}"


def _data_sheet(noise: Noise, sensor: str) -> str:
    if sensor not in noise.data_sheet:
        return ""
    factor, unit = UNITS[sensor][WHITE]
    typical, found = noise.data_sheet[sensor], noise.of(sensor, WHITE)
    sheet = f"data sheet: {factor * typical:.3g} {unit} ({factor * typical * math.sqrt(2.0):.3g} one-sided, as printed)"
    return f"{sheet}; {found / typical:.2f} times that" if noise.is_significant(sensor, WHITE) else sheet
