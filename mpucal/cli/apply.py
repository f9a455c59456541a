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
from ..disk.whole import check_not_among
from ..errors import UsageError
from ..files import open_rows, open_writer
from ..files.csv import CsvText
from ..files.folder import captures_in
from ..files.formats import formats_in_memory, writable_formats
from ..files.rows import Rows
from ..result.correction import make_correction
from .loading import loaded
from .recording_options import hint_options, hints_of, say_taken

EXAMPLE = "Example: `mpucal apply board7/calibration.json walk.npz -o walk-calibrated.mcap`"


HELP = f"""Apply a calibration (.json or .bin) to any recording that `mpucal calibrate` reads, however long.

The result is in m/s² and rad/s, in the calibration's body frame. Only {formats_in_memory()} is loaded as a whole.
"""


@click.command("apply", help=HELP, epilog=EXAMPLE)
@click.argument("calibration", metavar="CALIBRATION", type=click.Path(path_type=Path))
@click.argument("file", metavar="FILE|DIR", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "target",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help=f"Output file: {writable_formats()}, by its suffix; default: a table on stdout.",
)
@click.option("--json", "as_json", is_flag=True, help="Print a summary as JSON; needs -o.")
@hint_options()
def command(calibration: Path, file: Path, target: Path | None, as_json: bool, **hints: Any) -> None:
    """Pass the samples through, a run at a time."""
    if as_json and target is None:
        raise UsageError("--json was given without -o, and the samples go to stdout", "name a file with -o")
    if target is not None:
        check_not_among(target, (calibration, file, *captures_in(file)))
    rows = open_rows(file, hints_of(hints))
    say_taken(rows.taken)
    if rows.done:
        raise UsageError(f"{file} is calibrated already ({rows.done})", "give the uncalibrated recording")
    ready = make_correction(loaded(calibration), rows.sensor, rows.autopilot)
    for remark in (*ready.remarks, *_remarks(rows)):
        click.echo(f"mpucal: {remark}", err=True)
    noise = np.array([ready.calibration.noise_std, ready.calibration.gyro_noise_std])
    done = f"calibrated with {calibration.name} of {ready.calibration.created or 'an unknown time'}"
    seen = _Seen()
    with (
        nullcontext(CsvText(lambda text: sys.stdout.write(text.decode()), rows.utc_ns).write)
        if target is None
        else open_writer(target, replace(rows, noise=noise), done) as write
    ):
        for samples in rows.runs:
            after = ready.apply(samples)
            seen.add(samples, after, magnitudes=as_json)
            write(after)
    if as_json:
        click.echo(json.dumps({"file": str(target), "done": done, "utc_ns": rows.utc_ns, **seen.facts()}, indent=2))
    elif target is not None:
        lack = f", {seen.lack} of which lack a number" if seen.lack else ""
        click.echo(f"{target}: {seen.samples} samples{lack}, {done}.")


def _remarks(rows: Rows) -> tuple[str, ...]:
    others = f"Of {rows.name} this is the first IMU; {rows.others} more are in it." if rows.others else None
    undated = (
        None if rows.utc_ns is not None else f"{rows.name} does not say the time of day: its times stay as they are."
    )
    return tuple(filter(None, (rows.recovered, others, undated)))


class _Seen:
    """How many samples there were, how many lack a number, and the others' mean |a|."""

    def __init__(self) -> None:
        self.samples, self.lack, self._before, self._after = 0, 0, 0.0, 0.0

    def add(self, before: Samples, after: Samples, magnitudes: bool) -> None:
        self.samples += len(before)
        self.lack += int(np.isnan(after.acc[:, 0]).sum())
        # they take as long as all the rest
        if not magnitudes:
            return
        there = ~np.isnan(after.acc[:, 0])
        self._before += float(np.linalg.norm(before.acc[there], axis=1).sum())
        self._after += float(np.linalg.norm(after.acc[there], axis=1).sum())

    def facts(self) -> dict[str, Any]:
        n = max(self.samples - self.lack, 1)
        means = {"mean_before_mps2": self._before / n, "mean_after_mps2": self._after / n}
        return {"samples": self.samples, "lack_a_number": self.lack, **means}
