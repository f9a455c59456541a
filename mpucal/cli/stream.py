"""`mpucal stream`: print calibrated samples live, for another program to read."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from ..data import STANDARD_GRAVITY_MPS2, Samples
from ..disk.place import check_free
from ..errors import EndOfCapture
from ..files.csv import NS, CsvText
from ..page.address import Address
from ..page.live import live
from ..recheck import days_since
from ..recheck.watch import Contradiction, DriftMonitor
from ..result.calibration import Calibration
from ..result.clock import now
from ..result.correction import Correction, make_correction
from ..session.events import Caution
from ..session.ports import Source
from ..sources.opening import open_source
from ..sources.table import source_title
from ..terminal.flat import BOARD, VEHICLE
from ..terminal.keys import Keys
from ..terminal.lines import JsonLines
from .loading import loaded
from .options import ABOVE_ZERO, check_gyroscope, check_source, source_options
from .page import page_options

EXAMPLE = "Example: `mpucal stream --bus /dev/i2c-1 --apply board7/calibration.json --seconds 10`"


@click.command("stream", epilog=EXAMPLE)
@source_options("stream")
@click.option("--apply", "calibration", metavar="CALIBRATION", type=click.Path(path_type=Path), required=True)
@click.option("-o", "file", metavar="FILE", type=click.Path(path_type=Path), help="Record a capture as well.")
@click.option("--seconds", type=ABOVE_ZERO, help="Stop after this time [s].")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line instead of a table.")
@click.option("--watch", "watched", is_flag=True, help="Warn where rests contradict CALIBRATION.")
@click.option("--json-events", is_flag=True, help="Print each warning as a line of JSON on stderr.")
@page_options
def command(
    calibration: Path,
    file: Path | None,
    seconds: float | None,
    as_json: bool,
    watched: bool,
    json_events: bool,
    page: Address | None,
    board: str | None,
    **options: Any,
) -> None:
    """Print calibrated samples, m/s² and rad/s, until Ctrl-C or --seconds; `mpucal apply` does it to recorded ones.

    Memory use is constant, so it may run for days. Timestamps are provisional; record a capture for final ones. The
    time of day is the computer's when the first samples were read.
    """
    check_source(click.get_current_context())
    applied = loaded(calibration)
    if file is not None:
        check_free(file)
    # a simulated chip lives in the gravity in which it was calibrated
    gravity = applied.fit.get("gravity") or STANDARD_GRAVITY_MPS2
    source = open_source({**options, "gravity": gravity}, until_end=True)
    if page is not None:
        check_gyroscope(source.plan.config)
    text = CsvText(lambda text: sys.stdout.write(text.decode()))
    shown = live(page, source_title(options), board or (VEHICLE if options.get("mavlink") else BOARD))
    talk = _Talk(json_events)
    capture = source.measuring(file or Path(os.devnull), talk.say, now().isoformat())
    with capture as measuring, shown as screen, suppress(KeyboardInterrupt):
        ready: Correction | None = None
        watch: DriftMonitor | None = None
        for samples in _polled(measuring.source, seconds):
            if ready is None:
                # the newest sample was read just now
                text.utc_ns = time.time_ns() - round(float(samples.t[-1]) * NS)
                sensor = measuring.source.recording().sensor
                ready = _correction(applied, measuring.source, talk)
                watch = DriftMonitor(ready.calibration, days_since(applied)) if watched else None
            calibrated = ready.apply(samples)
            if as_json:
                _json_lines(calibrated, text.utc_ns or 0)
            else:
                text.write(calibrated)
            screen.add(samples, calibrated, sensor)
            for finding in () if watch is None else watch.add(calibrated):
                talk.warn(finding)
                screen.say(str(finding))
            sys.stdout.flush()
            measuring.source.forget()


class _Talk:
    """What is said on stderr, as sentences or as events of a line of JSON each."""

    def __init__(self, as_json: bool) -> None:
        self._events = JsonLines(sys.stderr, Keys()) if as_json else None

    def say(self, text: str) -> None:
        """A sentence."""
        if self._events is None:
            click.echo(f"mpucal: {text.strip()}", err=True)
        else:
            self._events.say(text)

    def warn(self, finding: Contradiction) -> None:
        """Of what rests contradict."""
        if self._events is None:
            self.say(str(finding))
        else:
            self._events.hear(Caution(finding.t_s, f"{finding.sensor}_contradicted", finding.what, finding.do))


def _polled(source: Source, seconds: float | None) -> Iterator[Samples]:
    """Samples as they come, whatever ends them."""
    with suppress(EndOfCapture):
        source.start()
        begun_ns = source.now_ns()
        try:
            while seconds is None or source.now_ns() - begun_ns < seconds * 1e9:
                samples = source.poll()
                if len(samples):
                    yield samples
        finally:
            source.stop()


def _correction(calibration: Calibration, source: Source, talk: _Talk) -> Correction:
    recording = source.recording()
    ready = make_correction(calibration, recording.sensor, recording.autopilot)
    for remark in ready.remarks:
        talk.say(remark)
    return ready


def _json_lines(samples: Samples, utc_ns: int) -> None:
    columns: list[Callable[[], Any]] = [samples.t.tolist, samples.acc.tolist, samples.gyr.tolist]
    for t, a, w, warm in zip(*(column() for column in columns), samples.temperature_c.tolist(), strict=True):
        temperature_c = warm if warm == warm else None  # noqa: PLR0124 - NaN, which JSON has not
        turning = w if w[0] == w[0] else None
        print(
            json.dumps({"t": t, "a": a, "w": turning, "temperature_c": temperature_c, "utc_ns": utc_ns + round(t * NS)})
        )
