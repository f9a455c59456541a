"""The report as one HTML file."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from datetime import datetime

import numpy as np

from .. import __version__
from ..data import Recording
from ..origin import Origin
from ..result.calibration import GOOD, REFUSED, USABLE, Calibration
from ..result.session_files import CAPTURE, is_of_session
from . import sections
from .elements import (
    as_float,
    code,
    details,
    document,
    escape,
    first,
    number,
    pair,
    paragraph,
    quantity,
    section,
    table,
)
from .pictures import gallery
from .track import Track
from .units import estimated_error

VERDICTS = {
    GOOD: "Good: the model explains the measurements, and every parameter is well determined.",
    USABLE: "Usable, with the reservations below.",
    REFUSED: "Refused: do not use these parameters.",
}


def render(calibration: Calibration, recording: Recording | None = None) -> str:
    """Return the report of a calibration; with its recording, it includes pictures. Collapsed parts are not printed."""
    no_pictures = recording is not None and not calibration.is_regular
    track = None if recording is None or no_pictures else Track(recording, calibration)
    drawn: Mapping[str, str] = defaultdict(str) if track is None else gallery(track)
    body = (
        _verdict(calibration, recording),
        first(sections.other_uses(calibration), sections.accelerometer_section(calibration)),
        sections.verification_section(calibration),
        section(
            "At rest, before and after",
            _magnitudes(track),
            paragraph("D cannot be inverted, so there are no pictures.", note=True) if no_pictures else "",
            pair(drawn["sphere"], drawn["residuals"]),
        ),
        section("Orientations and motion", pair(drawn["coverage"], drawn["innovations"])),
        sections.vehicle_section(calibration),
        details("The formula", sections.formula(calibration)),
        details("The gyroscope", sections.gyroscope_table(calibration), drawn["rates"]),
        details("Over time", drawn["magnitude"], drawn["temperature"]),
        details("Sensor and settings", _settings(calibration, recording)),
        details("Parameters in calibration.json", sections.matrices(calibration)),
        details("How to reproduce it", _reproduction(calibration, recording)),
        paragraph(f"Made by mpucal {__version__}.", note=True),
    )
    chip, name = calibration.sensor.chip, calibration.extra.get("name")
    title = f"Calibration of {name or _article(chip)}"
    temperature = quantity(calibration.sensor.temperature_c, "°C", digits=3)
    facts = filter(None, [chip if name else "", _date(calibration.created), temperature])
    return document(title, title, paragraph(", ".join(facts), "facts", note=True), *body)


def _date(created: str) -> str:
    """Return a date such as 22 November 2026, 03:23 UTC; other text is returned unchanged."""
    try:
        date = datetime.fromisoformat(created)
    except ValueError:
        return created
    return f"{date.day} {date:%B %Y, %H:%M} {date.tzname() or ''}".strip()


def _article(chip: str | None) -> str:
    return f"an {chip}" if chip and chip[0] in "AEIMO" else f"a {chip}" if chip else "an accelerometer"


def _verdict(calibration: Calibration, recording: Recording | None) -> str:
    verdict = calibration.verdict
    sentence = " ".join([VERDICTS.get(verdict, f"The verdict is {verdict}."), estimated_error(calibration)]).strip()
    reasons = "".join(
        f"<li><code>{escape(str(reason['code']))}</code>: {escape(str(reason['message']))}</li>\n"
        for reason in calibration.quality.get("reasons", ())
    )
    listed = f'<ul id="reasons">\n{reasons}</ul>\n' if reasons else ""
    recovered = paragraph(recording.recovered, note=True) if recording and recording.recovered else ""
    headline = f'<p class="verdict {escape(verdict)}" id="verdict">{escape(sentence)}</p>\n'
    return f"{headline}{listed}{sections.next_step(calibration)}{recovered}"


def _magnitudes(track: Track | None) -> str:
    """Return a table of |a| of the rests before and after; empty if there are no rests."""
    if track is None or not len(track.runs):
        return ""
    rows = []
    for name, acc in (("before", track.recording.acc), ("after", track.calibrated)):
        of_rests = np.linalg.norm(track.at_rest(acc), axis=1)
        rows.append([name, *(number(f(of_rests), 4) for f in (np.median, np.mean, np.std))])
    caption = f"|a| of {len(track.runs)} rests, m/s²; gravity is {track.gravity:.6g}"
    return table("magnitudes", caption, ["", "median", "mean", "standard deviation"], rows)


def _settings(calibration: Calibration, recording: Recording | None) -> str:
    sensor, fit = calibration.sensor, calibration.fit
    rows = [
        ("sensor" if sensor.origin is Origin.VEHICLE else "chip", sensor.chip),
        ("WHO_AM_I", None if sensor.who_am_i is None else f"0x{sensor.who_am_i:02x}"),
        ("accelerometer range", quantity(sensor.accel_range_g, "g", "±")),
        ("gyroscope range", quantity(sensor.gyro_range_dps, "deg/s", "±")),
        ("sample rate", quantity(sensor.rate_hz, "Hz")),
        ("temperature", quantity(sensor.temperature_c, "°C")),
        ("gravity", quantity(fit.get("gravity"), "m/s²")),
        ("model", fit.get("model")),
        ("why this model", fit.get("why")),
        ("samples", fit.get("samples")),
        ("duration", quantity(fit.get("seconds"), "s")),
        ("iterations", fit.get("iterations")),
        ("NIS a sample (3 expected)", quantity(fit.get("nis"), "")),
        ("recording", None if recording is None else recording.name),
        ("made", calibration.created or None),
    ]
    known = [[name, str(value)] for name, value in rows if value is not None]
    return table("settings", "", [], known, words=0)


def _reproduction(calibration: Calibration, recording: Recording | None) -> str:
    """Return the commands that reproduce the numbers; empty if the recording is not known."""
    gravity, model = as_float(calibration.fit.get("gravity")), calibration.fit.get("model")
    if recording is None or model is None or not math.isfinite(gravity):
        return ""
    # a resumed session has several captures, so its folder is given
    source = "." if CAPTURE.matches(recording.name) else recording.name
    anyway = " --gravity-anyway" if calibration.fit.get("gravity_anyway") else ""
    lines = [f"mpucal calibrate {source} --model {model} --gravity {gravity:.9g}{anyway} -o again"]
    if is_of_session(recording.name):
        lines.append(f"mpucal session --replay {source} -o replayed")
    intro = paragraph(
        "Run them in the folder of this page. The first calibrates the recording again; the second replays the whole "
        "session, prompt by prompt, if a session made the recording."
        if len(lines) > 1
        else "Run it in the folder of the recording:"
    )
    return intro + code("\n".join(lines), "reproduce")
