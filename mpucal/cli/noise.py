"""`mpucal noise`: measure the noise of a sensor that lies still."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import Any

import click

from ..allan import NoiseMeter
from ..data import Samples, Sensor
from ..disk.output_folder import OutputFolder
from ..errors import EndOfCapture, RecordingError, SourceError
from ..files import open_rows
from ..files.rows import drop_incomplete
from ..report.noise import render, summary
from ..result.clock import duration, iso_utc
from ..result.noise import Noise
from ..session.boards import speak_of, usual_board
from ..session.lay_flat import PUT_DOWN, put_down
from ..session.ports import Source, polled
from ..session.results import save
from ..sources.opening import open_source
from .common import PATH, PROGRESS_S, json_option, output_option, say
from .options import ABOVE_ZERO, given_options
from .recording_options import given_hints, hint_options, say_interpretation
from .source_options import check_input, check_source, source_options

EXAMPLE = "Example: `mpucal noise walk.npz -o noise`, or `mpucal noise --bus sim --hours 0.02`"
DOCUMENT, PAGE = "noise.json", "noise.html"
# Wanted relative standard uncertainty of the bias instability.
WANTED_STD = 0.1


@click.command("noise", epilog=EXAMPLE)
@click.argument("file", metavar="[FILE|DIR]", type=PATH, required=False)
@source_options("noise")
@hint_options("accel_range", "gyro_range", "rate")
@click.option("--hours", type=ABOVE_ZERO, help="Measure for this long; else until Ctrl-C.")
@output_option("folder", "DIR", "Folder for noise.json and noise.html.")
@json_option("Print JSON.")
def command(file: Path | None, hours: float | None, folder: Path | None, as_json: bool, **options: Any) -> None:
    """Measure the noise of a sensor that lies still: white noise, bias instability, random walk, quantisation.

    The overlapping Allan deviation of all six axes is computed in constant memory, with 95 % intervals, and compared
    with the data sheet. Ctrl-C ends a measurement and keeps its result. `mpucal export --noise` and `mpucal calibrate
    --noise` take noise.json.
    """
    check_input(file, options, "noise")
    failure: SourceError | None = None
    if file is not None:
        noise = _measure_file(file, options)
    else:
        check_source(click.get_current_context())
        noise, failure = _measure_source(options, None if hours is None else 3600.0 * hours)
    click.echo(noise.json() if as_json else summary(noise), nl=not as_json)
    if folder is not None:
        with OutputFolder(folder) as into:
            save(into.path, {PAGE: render(noise).encode(), DOCUMENT: noise.json().encode()})
        click.echo(f"\nWritten to {folder}:\n  {DOCUMENT}, {PAGE}", err=as_json)
    if failure is not None:
        failure.what += f"; the noise is that of the {duration(noise.seconds)} until then"
        raise failure


def _measure_file(file: Path, options: dict[str, Any]) -> Noise:
    rows = open_rows(file, given_hints(options))
    say_interpretation(rows)
    meter = NoiseMeter(rows.sensor)
    for samples in rows.runs:
        meter.add(drop_incomplete(samples))
    return meter.result(iso_utc())


def _measure_source(options: dict[str, Any], seconds: float | None) -> tuple[Noise, SourceError | None]:
    """Measure until the time is over, the source ends or fails, or Ctrl-C is pressed; return the failure as well."""
    source = open_source(options, given_options(), until_end=True)
    meter: NoiseMeter | None = None
    failure: SourceError | None = None
    with source.measuring(Path(os.devnull), say, iso_utc()) as measuring, _progress() as show_progress:
        # The result so far is kept, whatever ends the measurement.
        try:
            sensor = measuring.source.start()
            # A person needs five runs, of a second each, to put the board down.
            skipped = 0 if options["replay"] else 5
            if skipped:
                put_down(source.listeners, say, speak_of(PUT_DOWN, usual_board(source.origin)))
            for samples in islice(_runs(measuring.source), skipped, None):
                meter = meter or NoiseMeter(sensor)
                meter.add(samples)
                measuring.source.forget()
                show_progress(meter, seconds)
                if seconds is not None and meter.seconds >= seconds:
                    break
        except (KeyboardInterrupt, EndOfCapture):
            pass
        except SourceError as error:
            failure = error
        with suppress(EndOfCapture, SourceError):
            measuring.source.stop()
    try:
        return (meter or NoiseMeter(Sensor())).result(iso_utc()), failure
    except RecordingError as error:
        raise failure or error from None


def _runs(source: Source) -> Iterator[Samples]:
    """Yield samples in runs of a second: the meter could not keep up with many small ones."""
    held: list[Samples] = []
    for samples in filter(len, polled(source)):
        held.append(samples)
        if samples.t[-1] - held[0].t[0] >= 1.0:
            yield Samples.joined(held)
            held = []


@contextmanager
def _progress() -> Iterator[Any]:
    """Yield a function that shows the progress: on one line of a terminal, elsewhere a line a minute."""
    on_a_terminal = sys.stderr.isatty()
    shown_s = monotonic()

    def show(meter: NoiseMeter, seconds: float | None) -> None:
        nonlocal shown_s
        if monotonic() - shown_s < (PROGRESS_S if on_a_terminal else 60.0):
            return
        shown_s = monotonic()
        of = "" if seconds is None else f" of {duration(seconds)}"
        needed_s = meter.needed_s(WANTED_STD)
        more = "" if needed_s is None else f"; bias instability to {100 * WANTED_STD:.0f} %: {duration(needed_s)} more"
        text = f"{duration(meter.seconds)}{of}{more}"
        click.echo(f"\r{text}   " if on_a_terminal else text, err=True, nl=not on_a_terminal)

    try:
        yield show
    finally:
        if on_a_terminal:
            click.echo(err=True)
