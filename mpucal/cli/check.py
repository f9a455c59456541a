"""`mpucal check`: whether a calibration is still right for its sensor, in half a minute or from a recording."""

from __future__ import annotations

import json
import os
import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..data import Recording
from ..disk.folder import Folder
from ..disk.whole import check_not_among
from ..errors import UsageError
from ..files import load
from ..page.address import Address
from ..page.result import Result
from ..recheck import check
from ..recheck.outcome import CheckResult
from ..recheck.update import update_biases
from ..result.calibration import Calibration
from ..result.clock import now
from ..result.session_files import BLOB, DOCUMENT
from ..session.folder import SessionFolder
from ..session.results import check_owner, save
from ..sinks.choose import choose_sinks
from ..sinks.record import file_recorder
from ..sinks.table import SINKS
from ..sinks.write_back import write_to_all
from ..sources.opened_source import OpenedSource
from ..sources.opening import one_of, open_source
from ..sources.table import kinds_for, matching_kinds, source_title
from ..terminal.console import Console, console
from ..terminal.flat import BOARD, VEHICLE
from .destination import device
from .loading import force_option, loaded, trusted
from .options import check_gyroscope, check_source, given, source_options
from .page import beside, page_options
from .person import ask, ask_in_doubt
from .recording_options import given_hints, hint_options, say_taken
from .running import running

EXAMPLE = (
    "Example: `mpucal check board7/calibration.json walk.npz`, or `mpucal check board7/calibration.json --bus sim`"
)
CHECK_FILE = "check.json"


@click.command("check", epilog=EXAMPLE)
@click.argument("calibration", metavar="CALIBRATION", type=click.Path(path_type=Path))
@click.argument("file", metavar="[FILE|DIR]", type=click.Path(path_type=Path), required=False)
@source_options("check")
@hint_options("accel_range", "gyro_range", "rate")
@click.option(
    "-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the updated calibration."
)
@click.option(
    "--to", "sinks", type=click.Choice(list(SINKS)), multiple=True, help="Write the updated calibration there, too."
)
@click.option("--yes", is_flag=True, help="Ask no questions.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
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

    From a sensor it takes half a minute: lay the board flat, then hold it in three orientations. From a recording, it
    takes the rests that are there. -o writes an updated calibration where only the biases moved. Exit code 0: still
    good; 5: drifted, remounted or another sensor; 4: it cannot be told, and why; 6: with -o, CALIBRATION was damaged or
    changed after it was saved.
    """
    kinds = matching_kinds(options)
    if (file is None) == (not kinds):
        what = "a file and a source were given together" if kinds else "nothing to check it by was given"
        raise UsageError(what, f"give a recording, or {one_of(kinds_for('check'))}")
    if page is not None and file is not None:
        raise UsageError("--page was given without a source", "a recording needs no guidance: leave --page away")
    if sinks and (folder is None or file is not None):
        raise UsageError(
            "--to was given without -o and a source", "name the folder and the source, which is written to"
        )
    of = loaded(calibration) if folder is None else trusted(calibration, force)
    if folder is not None:
        for name in (BLOB.name, DOCUMENT.name):
            check_not_among(folder / name, [calibration])
    if file is not None:
        recording = load(file, given_hints(options))
        say_taken(recording.taken)
        if folder is not None:
            check_owner(folder, of, None, "check", str(calibration), str(file))
        with nullcontext() if folder is None else Folder(folder) as place:
            return _told(of, place, as_json, recording)[0].exit_code
    check_source(click.get_current_context())
    # a simulated chip lives in the gravity in which it was calibrated
    options = {**options, **({"gravity": of.fit["gravity"]} if of.fit.get("gravity") else {})}
    source = open_source(options, given())
    check_gyroscope(source.plan.config)
    board = board or (VEHICLE if options.get("mavlink") else BOARD)
    title = source_title(options)
    terminal = console(quiet=yes, title=title, board=board)
    attended = not yes and sys.stdin.isatty() and sys.stderr.isatty()
    with (
        nullcontext() if folder is None else SessionFolder(folder, source.capture_name) as into,
        beside(terminal, page, source, options, title, board, attended=attended) as (person, tell),
    ):
        result, files = _told(of, into, as_json, _measured(source, into, person))
        tell(Result(result.verdict, summary=result.page()), files)
        if sinks and into is not None and result.only_biases:
            _write_back(sinks, into.path, options, yes, as_json)
    return result.exit_code


def _told(
    of: Calibration, folder: Folder | None, as_json: bool, recording: Recording
) -> tuple[CheckResult, list[Path]]:
    """Check, print what was found, and leave its files."""
    result = check(of, recording)
    click.echo(json.dumps(result.document(), indent=2) if as_json else result.page())
    return result, [] if folder is None else _left(folder.path, of, result, recording, as_json)


def _measured(source: OpenedSource, into: SessionFolder | None, person: Console) -> Recording:
    """What the person showed; its capture is kept with -o."""
    with running(source, Path(os.devnull) if into is None else into.capture, person, checking=True) as runner:
        try:
            return runner.measure()
        finally:
            if into is not None:
                into.settle(runner.sensor)


def _left(folder: Path, of: Calibration, result: CheckResult, recording: Recording, as_json: bool) -> list[Path]:
    """check.json, and where only the biases moved calibration.json and calibration.bin."""
    files = {CHECK_FILE: (json.dumps(result.document(), indent=2) + "\n").encode()}
    if result.only_biases:
        after = update_biases(of, result, recording, now().isoformat())
        files |= {BLOB.name: after.blob().encode(), DOCUMENT.name: after.json().encode()}
    save(folder, files)
    click.echo(f"\nWritten to {folder}:\n  {', '.join(files)}", err=as_json)
    return [folder / name for name in files]


def _write_back(sinks: tuple[str, ...], folder: Path, options: dict[str, Any], yes: bool, as_json: bool) -> None:
    """Write the updated calibration to the source's own sinks."""
    path = folder / DOCUMENT.name
    kinds = choose_sinks(sinks, False, matching_kinds(options)[0])
    confirm, in_doubt = partial(ask, yes=yes), partial(ask_in_doubt, yes=yes)
    sensor, record = device(options), file_recorder(path)
    for applied in write_to_all(kinds, Calibration.load(path), sensor, folder, record, confirm, sinks, in_doubt):
        click.echo(f"Done: {applied.what}.", err=as_json)
