"""The report as one HTML file that needs no network and no script. Judges nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from ..data import Recording, Vector
from ..result import ACCELEROMETER_FORMULA, Calibration
from .picture import magnitude_svg
from .style import CSS

VERDICTS = {
    "good": "Good: the calibration explains what the sensor measured, and each parameter is well known.",
    "usable": "Usable, with the reservations below.",
    "refused": "Refused: do not use these numbers.",
}
_AXES = "xyz"


def render(calibration: Calibration, recording: Recording | None = None) -> str:
    """The page of a calibration; with its recording, also the picture of |a| before and after."""
    sections = (
        _verdict(calibration, recording),
        _section("Accelerometer", _parameters(calibration)),
        _section("Use", _formula(calibration)),
        _section("Magnitude of the acceleration", _magnitudes(calibration) + _picture(calibration, recording)),
        _section("Sensor and settings", _settings(calibration, recording)),
    )
    title = f"Calibration of {calibration.sensor.chip or 'an accelerometer'}"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{''.join(sections)}</body>\n</html>\n"
    )


def _verdict(calibration: Calibration, recording: Recording | None) -> str:
    verdict = calibration.verdict
    sentence = VERDICTS.get(verdict, f"The verdict is {verdict}.")
    reasons = "".join(
        f"<li><code>{escape(str(reason['code']))}</code>: {escape(str(reason['message']))}</li>\n"
        for reason in calibration.quality.get("reasons", ())
    )
    listed = f'<ul id="reasons">\n{reasons}</ul>\n' if reasons else ""
    recovered = f"<p>{escape(recording.recovered)}</p>\n" if recording and recording.recovered else ""
    return f'<p class="verdict {escape(verdict)}" id="verdict">{escape(sentence)}</p>\n{listed}{recovered}'


def _parameters(calibration: Calibration) -> str:
    rows = [[f"D {axis}", *map(_with_std, calibration.D[i], calibration.D_std[i])] for i, axis in enumerate(_AXES)]
    rows.append(["b_a, m/s²", *map(_with_std, calibration.b_a, calibration.b_a_std)])
    rows.append(["noise, m/s²", *(_number(value) for value in calibration.noise_std)])
    return _table("parameters", "value ± standard deviation", ["", *_AXES], rows)


def _formula(calibration: Calibration) -> str:
    if not _is_regular(calibration.D):
        return '<p class="note" id="formula">D cannot be inverted: these numbers correct nothing.</p>\n'
    gain = np.linalg.inv(calibration.D)
    bias = calibration.b_a - calibration.applied_in_hardware
    lines = [
        f"a_{axis} = "
        + " ".join(
            f"{factor:+.6f} * (y_{of} {-offset:+.6f})" for factor, of, offset in zip(gain[i], _AXES, bias, strict=True)
        )
        for i, axis in enumerate(_AXES)
    ]
    note = ""
    if np.any(calibration.applied_in_hardware):
        note = (
            '<p class="note">The chip\'s offset registers subtract a part of b_a already; the numbers above'
            " are what is left to subtract.</p>\n"
        )
    return (
        f"<p><code>{escape(ACCELEROMETER_FORMULA)}</code>, in m/s², y being what the sensor delivers:</p>\n"
        f'<pre id="formula">{escape(chr(10).join(lines))}</pre>\n{note}'
    )


def _magnitudes(calibration: Calibration) -> str:
    rows = []
    for name in ("before", "after"):
        values: Mapping[str, Any] = calibration.quality.get(f"magnitude_{name}") or {}
        rows.append([name, *(_number(values.get(key)) for key in ("median", "mean", "std"))])
    return _table("magnitudes", "|a|, m/s²", ["", "median", "mean", "std"], rows)


def _picture(calibration: Calibration, recording: Recording | None) -> str:
    if recording is None:
        return ""
    if not _is_regular(calibration.D):
        return '<p class="note">D cannot be inverted: there is no picture.</p>\n'
    before = np.linalg.norm(recording.acc, axis=1)
    after = np.linalg.norm(calibration.apply(recording.acc), axis=1)
    try:
        gravity = _float(calibration.fit.get("gravity"))
        return f'<div class="wide">{magnitude_svg(recording.t, before, after, gravity)}</div>\n'
    except ImportError:
        return (
            '<p class="note" id="no-picture">For a picture of |a| over time install matplotlib:'
            " <code>pip install 'mpucal[plot]'</code>.</p>\n"
        )


def _settings(calibration: Calibration, recording: Recording | None) -> str:
    sensor, fit = calibration.sensor, calibration.fit
    rows = [
        ("chip", sensor.chip),
        ("WHO_AM_I", None if sensor.who_am_i is None else f"0x{sensor.who_am_i:02x}"),
        ("accelerometer range", _quantity(sensor.accel_range_g, "g", "±")),
        ("gyroscope range", _quantity(sensor.gyro_range_dps, "deg/s", "±")),
        ("sample rate", _quantity(sensor.rate_hz, "Hz")),
        ("temperature", _quantity(sensor.temperature_c, "°C")),
        ("gravity", _quantity(fit.get("gravity"), "m/s²")),
        ("model", fit.get("model")),
        ("why this model", fit.get("why")),
        ("samples", fit.get("samples")),
        ("duration", _quantity(fit.get("seconds"), "s")),
        ("iterations", fit.get("iterations")),
        ("NIS a sample (3 expected)", _quantity(fit.get("nis"), "")),
        ("recording", None if recording is None else recording.name),
        ("made", calibration.created or None),
    ]
    known = [[name, str(value)] for name, value in rows if value is not None]
    return _table("settings", "", [], known, words=True)


def _section(title: str, content: str) -> str:
    return f"<section>\n<h2>{escape(title)}</h2>\n{content}</section>\n"


def _table(id_: str, caption: str, head: Iterable[str], rows: Iterable[Iterable[str]], words: bool = False) -> str:
    """A table whose rows begin with their names; every cell is escaped here."""
    cell = '<td class="words">' if words else "<td>"
    lines = [f'<div class="wide"><table id="{id_}">']
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    columns = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    if columns:
        lines.append(f"<tr>{columns}</tr>")
    for name, *values in rows:
        cells = "".join(f"{cell}{escape(value)}</td>" for value in values)
        lines.append(f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>')
    return "\n".join([*lines, "</table></div>\n"])


def _with_std(value: float, std: float) -> str:
    """A value to the second digit of its standard deviation."""
    if not (math.isfinite(std) and std > 0):
        return f"{_number(value)} ± {_number(std)}"
    digits = min(max(1 - math.floor(math.log10(std)), 0), 9)
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def _number(value: Any) -> str:
    number = _float(value)
    return f"{number:.6f}" if math.isfinite(number) else "unknown"


def _quantity(value: Any, unit: str, sign: str = "") -> str | None:
    number = _float(value)
    return f"{sign}{number:.6g} {unit}".rstrip() if math.isfinite(number) else None


def _float(value: Any) -> float:
    return math.nan if value is None else float(value)


def _is_regular(D: Vector) -> bool:
    return bool(np.isfinite(D).all() and np.linalg.matrix_rank(D) == 3)
