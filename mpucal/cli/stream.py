"""`mpucal stream`: print calibrated samples live, for another program to read."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import click

from ..clocks import S
from ..data import Samples
from ..disk.atomic import check_free
from ..errors import EndOfCapture
from ..files.csv import CsvText
from ..page.address import Address
from ..page.console import live_page
from ..recheck import days_since
from ..recheck.watch import Contradiction, DriftMonitor
from ..result.clock import iso_utc
from ..result.correction import Correction, make_correction
from ..session.events import Caution
from ..session.ports import Source, polled
from ..sources.opening import open_source
from ..sources.table import source_title
from ..terminal.console import JsonLines
from ..terminal.keys import Keys
from .common import CALIBRATION_PATH, at_gravity_of, json_option, load_calibration, output_option, say
from .options import ABOVE_ZERO
from .page import choose_board, page_options
from .source_options import check_source, source_options

EXAMPLE = "Example: `mpucal stream --bus /dev/i2c-1 --apply board7/calibration.json --seconds 10`"


@click.command("stream", epilog=EXAMPLE)
@source_options("stream")
@click.option(
    "--apply", "calibration", metavar="CALIBRATION", type=CALIBRATION_PATH, required=True, help="Calibration to apply."
)
@output_option("file", "FILE", "Record a capture as well.")
@click.option("--seconds", type=ABOVE_ZERO, help="Stop after this time [s].")
@json_option("Print one JSON object a line instead of a table.")
@click.option("--watch", "watched", is_flag=True, help="Warn if rests contradict CALIBRATION.")
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
    """Print calibrated samples, m/s² and rad/s, until Ctrl-C or --seconds; for recorded ones, use `mpucal apply`.

    Memory use is constant, so it may run for days. Timestamps are provisional; record a capture for final ones. The
    time of day is the computer's when the first samples were read.
    """
    check_source(click.get_current_context())
    applied = load_calibration(calibration)
    if file is not None:
        check_free(file)
    source = open_source(at_gravity_of(applied, options), until_end=True)
    text = CsvText(lambda text: sys.stdout.write(text.decode()), calibrated=True)
    on_page = nullcontext() if page is None else live_page(page, source_title(options), choose_board(board, source))
    events = JsonLines(sys.stderr, Keys()) if json_events else None
    tell = say if events is None else events.say
    capture = source.measuring(file or Path(os.devnull), tell, iso_utc())
    with capture as measuring, on_page as screen, suppress(KeyboardInterrupt):
        ready: Correction | None = None
        monitor: DriftMonitor | None = None
        for samples in _poll(measuring.source, seconds):
            if ready is None:
                # The newest sample was read just now.
                text.utc_ns = time.time_ns() - round(float(samples.t[-1]) * S)
                recording = measuring.source.recording()
                ready = make_correction(applied, recording.sensor, recording.autopilot)
                for remark in ready.remarks:
                    tell(remark)
                monitor = DriftMonitor(ready.calibration, days_since(applied)) if watched else None
            calibrated = ready.apply(samples)
            if as_json:
                _print_json(calibrated, text.utc_ns or 0)
            else:
                text.write(calibrated)
            if screen is not None:
                screen.add(samples, calibrated, recording.sensor)
            for contradiction in () if monitor is None else monitor.add(calibrated):
                _warn(contradiction, events)
                if screen is not None:
                    screen.say(str(contradiction))
            sys.stdout.flush()
            measuring.source.forget()


def _warn(contradiction: Contradiction, events: JsonLines | None) -> None:
    """Print a warning of the monitor on stderr, as a sentence or as an event."""
    if events is None:
        say(str(contradiction))
    else:
        code = f"{contradiction.sensor}_contradicted"
        events.hear(Caution(contradiction.t_s, code, contradiction.what, contradiction.do))


def _poll(source: Source, seconds: float | None) -> Iterator[Samples]:
    """Yield samples as they arrive; stop the source in the end."""
    with suppress(EndOfCapture):
        source.start()
        try:
            yield from filter(len, polled(source, seconds))
        finally:
            source.stop()


def _print_json(samples: Samples, utc_ns: int) -> None:
    columns = (samples.t, samples.acc, samples.gyr, samples.temperature_c)
    for t, a, w, celsius in zip(*(column.tolist() for column in columns), strict=True):
        # JSON has no NaN.
        known = {"w": None if math.isnan(w[0]) else w, "temperature_c": None if math.isnan(celsius) else celsius}
        print(json.dumps({"t": t, "a": a, **known, "utc_ns": utc_ns + round(t * S)}))
