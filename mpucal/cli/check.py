"""`mpucal check`: check a calibration against its sensor, in half a minute, or against a recording."""

from __future__ import annotations

import json
import os
from collections import deque
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ..data import Recording
from ..disk.atomic import check_not_input
from ..disk.output_folder import OutputFolder
from ..errors import UsageError
from ..files import load
from ..page.address import Address
from ..page.feed import Result
from ..recheck import check
from ..recheck.outcome import CheckResult
from ..recheck.update import update_biases
from ..result.calibration import Calibration
from ..result.clock import iso_utc
from ..result.session_files import BLOB, DOCUMENT
from ..session.results import SessionFolder, calibration_files, check_owner, save
from ..sinks.choose import choose_sinks
from ..sinks.table import SINKS
from ..sinks.write_back import file_recorder
from ..sources.opened_source import OpenedSource
from ..sources.opening import open_source
from ..terminal.console import Console
from .common import (
    PATH,
    at_gravity_of,
    calibration_argument,
    force_option,
    json_option,
    load_calibration,
    load_trusted,
    output_option,
    yes_option,
)
from .destination import write_back
from .options import given_options
from .page import BOARD_KIND, page_options, show_session
from .recording_options import given_hints, hint_options, say_interpretation
from .running import open_runner
from .source_options import check_input, check_source, source_options

EXAMPLE = (
    "Example: `mpucal check board7/calibration.json walk.npz`, or `mpucal check board7/calibration.json --bus sim`"
)
CHECK_FILE = "check.json"


@click.command("check", epilog=EXAMPLE)
@calibration_argument
@click.argument("file", metavar="[FILE|DIR]", type=PATH, required=False)
@source_options("check")
@hint_options("accel_range", "gyro_range", "rate")
@output_option("folder", "DIR", "Folder for the updated calibration.")
@click.option(
    "--to", "sinks", type=click.Choice(list(SINKS)), multiple=True, help="Write the updated calibration there, too."
)
@yes_option
@force_option
@json_option("Print JSON.")
@page_options
def command(
    calibration: Path,
    file: Path | None,
    folder: Path | None,
    sinks: tuple[str, ...],
    yes: bool,
    force: bool,
    as_json: bool,
    page: Address | None,
    board: str | None,
    **options: Any,
) -> int:
    """Say whether CALIBRATION is still right for its sensor: still good, drifted, remounted, or another sensor.

    A sensor is checked in half a minute: lay the board flat, then hold it in three orientations. A recording is
    checked by the rests in it. If only the biases have changed, -o writes an updated calibration. Exit code 0: still
    good; 5: drifted, remounted or another sensor; 4: cannot be told, for the reason that is printed; 6: with -o,
    CALIBRATION was damaged or changed after it was saved.
    """
    kinds = check_input(file, options, "check")
    if page is not None and file is not None:
        raise UsageError("--page was given with a recording", "leave it out: a recording needs no guidance")
    if sinks and (folder is None or file is not None):
        raise UsageError("--to was given without -o and a source", "name the folder, and the source to write to")
    old = load_calibration(calibration) if folder is None else load_trusted(calibration, force)
    if folder is not None:
        for name in (BLOB.name, DOCUMENT.name):
            check_not_input(folder / name, [calibration])
    if file is not None:
        recording = load(file, given_hints(options))
        say_interpretation(recording)
        if folder is not None:
            check_owner(folder, old, None, "check", str(calibration), str(file))
        with nullcontext() if folder is None else OutputFolder(folder) as place:
            return _check(old, place, as_json, recording)[0].exit_code
    check_source(click.get_current_context())
    options = {**at_gravity_of(old, options), BOARD_KIND: board}
    source = open_source(options, given_options())
    _, shown = show_session(source, options, page, board, yes)
    with (
        nullcontext() if folder is None else SessionFolder(folder, source.capture_name) as into,
        shown as (person, show_result),
    ):
        result, files = _check(old, into, as_json, _measure(source, into, person))
        show_result(Result(result.verdict, summary=result.page()), files)
        if sinks and into is not None and result.only_biases:
            targets, document = choose_sinks(sinks, False, kinds[0]), into.path / DOCUMENT.name
            updated, record = Calibration.load(document), file_recorder(document)
            deque(write_back(targets, updated, options, into.path, record, sinks, yes, as_json), maxlen=0)
    return result.exit_code


def _check(
    old: Calibration, folder: OutputFolder | None, as_json: bool, recording: Recording
) -> tuple[CheckResult, list[Path]]:
    """Check, print the result, and write its files: check.json, and an updated calibration if only biases changed."""
    result = check(old, recording)
    click.echo(json.dumps(result.document(), indent=2) if as_json else result.page())
    if folder is None:
        return result, []
    files = {CHECK_FILE: (json.dumps(result.document(), indent=2) + "\n").encode()}
    if result.only_biases:
        new = update_biases(old, result, recording, iso_utc())
        files |= calibration_files(new)
    save(folder.path, files)
    click.echo(f"\nWritten to {folder.path}:\n  {', '.join(files)}", err=as_json)
    return result, [folder.path / name for name in files]


def _measure(source: OpenedSource, into: SessionFolder | None, person: Console) -> Recording:
    """Guide the person; return the recording, whose capture is kept with -o."""
    with open_runner(source, Path(os.devnull) if into is None else into.capture, person, checking=True) as runner:
        try:
            return runner.measure()
        finally:
            if into is not None:
                into.settle(runner.sensor)
