"""`mpucal apply`: apply a calibration to a recording."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..data import Samples
from ..disk.atomic import check_not_input
from ..errors import UsageError
from ..files import open_rows, open_writer
from ..files.csv import CsvText
from ..files.formats import writable_formats
from ..files.rows import Rows, is_complete
from ..result.correction import make_correction
from ..result.session_files import captures_in
from .common import PATH, calibration_argument, json_option, load_calibration, output_option, say
from .recording_options import hint_options, make_hints, say_interpretation

EXAMPLE = "Example: `mpucal apply board7/calibration.json walk.npz -o walk-calibrated.mcap`"


HELP = """Apply a calibration (.json or .bin) to any recording that `mpucal calibrate` reads.

The result is in m/s² and rad/s, in the calibration's body frame. A table in mpucal's own format and a chip's capture
may be longer than the memory; other recordings are loaded whole.
"""


@click.command("apply", help=HELP, epilog=EXAMPLE)
@calibration_argument
@click.argument("file", metavar="FILE|DIR", type=PATH)
@output_option("target", "FILE", f"Output file: {writable_formats()}, by its suffix; default: a table on stdout.")
@json_option("Print a summary as JSON; needs -o.")
@hint_options()
def command(calibration: Path, file: Path, target: Path | None, as_json: bool, **hints: Any) -> None:
    """Apply the calibration to a run of samples at a time."""
    if as_json and target is None:
        raise UsageError("--json was given without -o, and the samples go to stdout", "name a file with -o")
    if target is not None:
        check_not_input(target, (calibration, file, *captures_in(file)))
    rows = open_rows(file, make_hints(hints))
    say_interpretation(rows)
    if rows.done:
        raise UsageError(f"{file} is calibrated already ({rows.done})", "give the uncalibrated recording")
    ready = make_correction(load_calibration(calibration), rows.sensor, rows.autopilot)
    for remark in (*ready.remarks, *_remarks(rows)):
        say(remark)
    noise = np.array([ready.calibration.noise_std, ready.calibration.gyro_noise_std])
    done = f"calibrated with {calibration.name} of {ready.calibration.created or 'an unknown time'}"
    totals = _Totals()
    with (
        nullcontext(CsvText(lambda text: sys.stdout.write(text.decode()), rows.utc_ns, calibrated=True).write)
        if target is None
        else open_writer(target, replace(rows, noise=noise), done) as write
    ):
        for samples in rows.runs:
            after = ready.apply(samples)
            totals.add(samples, after, magnitudes=as_json)
            write(after)
    for note in rows.notes():
        say(note)
    if as_json:
        click.echo(json.dumps({"file": str(target), "done": done, "utc_ns": rows.utc_ns, **totals.facts()}, indent=2))
    elif target is not None:
        lack = f", {totals.lack} of which lack a number" if totals.lack else ""
        click.echo(f"{target}: {totals.samples} samples{lack}, {done}.")


def _remarks(rows: Rows) -> tuple[str, ...]:
    others = f"{rows.name} holds {rows.others} more IMUs; only the first one is converted." if rows.others else None
    undated = f"{rows.name} holds no time of day; its times are kept." if rows.utc_ns is None else None
    return tuple(filter(None, (others, undated)))


class _Totals:
    """Number of samples, number of those that lack a value, and mean |a| of the others before and after."""

    def __init__(self) -> None:
        self.samples, self.lack, self._before, self._after = 0, 0, 0.0, 0.0

    def add(self, before: Samples, after: Samples, magnitudes: bool) -> None:
        self.samples += len(before)
        complete = is_complete(after.acc, after.gyr)
        self.lack += len(before) - int(complete.sum())
        # To compute the magnitudes takes as long as all the rest.
        if magnitudes:
            self._before += float(np.linalg.norm(before.acc[complete], axis=1).sum())
            self._after += float(np.linalg.norm(after.acc[complete], axis=1).sum())

    def facts(self) -> dict[str, Any]:
        n = max(self.samples - self.lack, 1)
        means = {"mean_before_mps2": self._before / n, "mean_after_mps2": self._after / n}
        return {"samples": self.samples, "lack_a_number": self.lack, **means}
