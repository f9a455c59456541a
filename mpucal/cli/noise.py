"""`mpucal noise`: the noise of a sensor that lies still, from a long rest."""

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
from ..disk.folder import Folder
from ..errors import EndOfCapture, UsageError
from ..files import open_rows
from ..files.rows import drop_incomplete
from ..report.noise import render, summary
from ..result.clock import now
from ..result.noise import Noise
from ..session.lay_flat import put_down
from ..session.ports import Source
from ..session.results import save
from ..sources.opening import one_of, open_source
from ..sources.table import kinds_for, matching_kinds
from .options import ABOVE_ZERO, check_gyroscope, check_source, given, source_options
from .recording_options import given_hints, hint_options, say_taken

EXAMPLE = "Example: `mpucal noise walk.npz -o noise`, or `mpucal noise --bus sim --hours 0.02`"
DOCUMENT, PAGE = "noise.json", "noise.html"
# bias instability is wanted to this share of itself (1 sigma)
WANTED = 0.1
TELL_S = {True: 2.0, False: 60.0}
# the time in which a person puts the board down, in runs of a second
PUT_DOWN_RUNS = 5


@click.command("noise", epilog=EXAMPLE)
@click.argument("file", metavar="[FILE|DIR]", type=click.Path(path_type=Path), required=False)
@source_options("noise")
@hint_options("accel_range", "gyro_range", "rate")
@click.option("--hours", type=ABOVE_ZERO, help="Measure for this long; else until Ctrl-C.")
@click.option(
    "-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Folder for noise.json and noise.html."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(file: Path | None, hours: float | None, folder: Path | None, as_json: bool, **options: Any) -> None:
    """Measure the noise of a sensor that lies still: white noise, bias instability, random walk, quantisation.

    By the overlapping Allan deviation of all six axes, with 95 % intervals, beside the data sheet's values, in constant
    memory. Ctrl-C ends a measurement and keeps what there is. `mpucal export --noise` and `mpucal calibrate --noise`
    take noise.json.
    """
    kinds = matching_kinds(options)
    if (file is None) == (not kinds):
        what = "a file and a source were given together" if kinds else "nothing to measure was given"
        raise UsageError(what, f"give a recording, or {one_of(kinds_for('noise'))}")
    if file is not None:
        noise = _of_file(file, options)
    else:
        check_source(click.get_current_context())
        noise = _of_source(options, None if hours is None else 3600.0 * hours)
    click.echo(noise.json() if as_json else summary(noise), nl=not as_json)
    if folder is not None:
        with Folder(folder) as into:
            save(into.path, {PAGE: render(noise).encode(), DOCUMENT: noise.json().encode()})
        click.echo(f"\nWritten to {folder}:\n  {DOCUMENT}, {PAGE}", err=as_json)


def _of_file(file: Path, options: dict[str, Any]) -> Noise:
    rows = open_rows(file, given_hints(options))
    say_taken(rows.taken)
    meter = NoiseMeter(rows.sensor)
    for samples in rows.runs:
        meter.add(drop_incomplete(samples))
    return meter.result(now().isoformat())


def _of_source(options: dict[str, Any], seconds: float | None) -> Noise:
    """Until the time is over, the source ends, or a person ends it."""
    source = open_source(options, given(), until_end=True)
    check_gyroscope(source.plan.config)
    meter: NoiseMeter | None = None
    with source.measuring(Path(os.devnull), _say, now().isoformat()) as measuring, _progress() as tell:
        # what has been measured outlives who ends it, and a source that fails
        with suppress(KeyboardInterrupt, EndOfCapture):
            sensor = measuring.source.start()
            left_out = 0 if options["replay"] else PUT_DOWN_RUNS
            if left_out:
                put_down(source.listeners, _say)
            for samples in islice(_polled(measuring.source), left_out, None):
                meter = meter or NoiseMeter(sensor)
                meter.add(samples)
                measuring.source.forget()
                tell(meter, seconds)
                if seconds is not None and meter.seconds >= seconds:
                    break
        with suppress(EndOfCapture):
            measuring.source.stop()
    return (meter or NoiseMeter(Sensor())).result(now().isoformat())


def _polled(source: Source) -> Iterator[Samples]:
    """Samples as they come, in runs of a second: many small ones would take longer than they last."""
    held: list[Samples] = []
    while True:
        held.append(source.poll())
        last = next((part for part in reversed(held) if len(part)), None)
        first = next((part for part in held if len(part)), None)
        if first is not None and last is not None and last.t[-1] - first.t[0] >= 1.0:
            yield Samples.joined(held)
            held = []


@contextmanager
def _progress() -> Iterator[Any]:
    """Tells how far it is: on one line of a terminal, elsewhere a line a minute."""
    on_a_terminal = sys.stderr.isatty()
    told_s = monotonic()

    def tell(meter: NoiseMeter, seconds: float | None) -> None:
        nonlocal told_s
        if monotonic() - told_s < TELL_S[on_a_terminal]:
            return
        told_s = monotonic()
        of = "" if seconds is None else f" of {_long(seconds)}"
        needed_s = meter.needed_s(WANTED)
        more = "" if needed_s is None else f"; bias instability to {100 * WANTED:.0f} %: {_long(needed_s)} more"
        said = f"{_long(meter.seconds)}{of}{more}"
        click.echo(f"\r{said}   " if on_a_terminal else said, err=True, nl=not on_a_terminal)

    try:
        yield tell
    finally:
        if on_a_terminal:
            click.echo(err=True)


def _long(seconds: float) -> str:
    minutes, hours = seconds / 60.0, seconds / 3600.0
    return f"{hours:.1f} h" if hours >= 1.0 else f"{minutes:.1f} min" if minutes >= 1.0 else f"{seconds:.0f} s"


def _say(text: str) -> None:
    click.echo(f"mpucal: {text.strip()}", err=True)
