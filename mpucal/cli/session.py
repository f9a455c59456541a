"""`mpucal session`: guide a person, calibrate, and leave the results in a folder."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..data import Recording
from ..errors import MpucalError, RefusedError
from ..mavlink.calibrate_vehicle import calibrate_vehicle
from ..page.address import Address
from ..result.calibration import REFUSED, Calibration
from ..result.session_files import CAPTURE_OF_VEHICLE, DOCUMENT, LOG
from ..session.folder import SessionFolder, check_unfinished
from ..sinks.choose import announce_sinks, choose_sinks
from ..sinks.kind import SinkKind
from ..sinks.record import session_recorder
from ..sinks.sink import Applied
from ..sinks.write_back import write_to_all
from ..sources.kind import NAME
from ..sources.opened_source import OpenedSource
from ..sources.opening import check_resume_options, open_source
from ..sources.resumed import open_resumed
from ..sources.table import matching_kinds, source_title
from ..terminal.console import Console, console
from ..terminal.flat import BOARD, VEHICLE
from ..terminal.hangup import outliving
from .destination import device, session_sink_options
from .options import aim_options, check_gravity, check_gyroscope, check_source, fit_options, given, source_options
from .page import beside, page_options
from .person import ask, ask_in_doubt
from .running import running
from .summary import on_a_page, summary, written

# as remedies say it
AGAIN = "start again"
# a simulated chip that is to run as fast as it can does so on a page, too
EXAMPLE = "Example: `mpucal session --bus /dev/i2c-1 -o board7`; without a board, `mpucal session --bus sim`"


@click.command("session", epilog=EXAMPLE)
@source_options("session")
@fit_options
@aim_options
@session_sink_options
@click.option("-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the results.")
@click.option(
    "--resume", metavar="DIR", type=click.Path(path_type=Path), help="Continue the interrupted session in DIR."
)
@click.option("--name", metavar="BOARD", help="What the board is called, for the screen, the page and the report.")
@click.option("--yes", is_flag=True, help="Ask no questions.")
@click.option("--json", "as_json", is_flag=True, help="Print only calibration.json.")
@click.option("--json-events", is_flag=True, help="Print each event as a line of JSON on stderr.")
@page_options
@click.option("--page-keys", is_flag=True, help="The page may press Enter, r and q as well.")
@click.option("--beep/--no-beep", default=None, help="Ring the bell at each new prompt; default: on a terminal.")
@click.option("--keep-going", is_flag=True, help="Go on when the terminal goes away, as a dropped ssh connection does.")
def command(
    folder: Path | None,
    name: str | None,
    yes: bool,
    as_json: bool,
    json_events: bool,
    beep: bool | None,
    keep_going: bool,
    sinks: tuple[str, ...],
    no_write: bool,
    page: Address | None,
    page_keys: bool,
    board: str | None,
    **options: Any,
) -> int:
    """Guide a person through laying flat, turning and verifying; calibrate; write the results.

    Files: capture.mcap, calibration.json, calibration.bin, report.html. A bridge and an autopilot also store the
    calibration. Exit code 4: stopped before there was enough data; 5: the calibration was refused; 6: the write-back
    was refused or failed.
    """
    check_gravity(options["gravity"], options["gravity_anyway"])
    resume: Path | None = options.pop("resume")
    attended = not yes and sys.stdin.isatty()
    source, kinds, options = _opened(resume, {**options, NAME: name}, sinks, no_write, attended)
    name = name or options.get(NAME)
    check_gyroscope(source.plan.config)
    title = f"{name}, {source_title(options)}" if name else source_title(options)
    board = board or (VEHICLE if source.capture_name == CAPTURE_OF_VEHICLE.name else BOARD)
    terminal = console(quiet=yes, as_json=json_events, beep=beep, title=title, board=board)
    seen = attended and sys.stderr.isatty() and not json_events
    hung_up = partial(terminal.hung_up, stop=page is None and not keep_going)
    with (
        SessionFolder(resume or folder, source.capture_name, again=resume is not None) as into,
        outliving(lambda: into.path / LOG.name, hung_up),
        beside(terminal, page, source, options, title, board, page_keys, json_events, seen) as (person, tell),
    ):
        # a program that reads the events finds it in calibration.json
        announcement = "" if json_events else announce_sinks(kinds, no_write)
        recording, calibration, paths = _run(source, into, person, announcement, name)
        files = [into.capture, *paths]
        tell(on_a_page(calibration), files)
        if not as_json:
            if not json_events:
                click.echo(err=True)
            click.echo(f"{summary(calibration)}\n\n{written(files)}")
        record = session_recorder(into.path, calibration, recording, source.truth)
        sensor = device({**options, "gravity": source.plan.gravity, "model": source.plan.model})
        confirm, in_doubt = partial(ask, yes=yes), partial(ask_in_doubt, yes=yes)
        writing = write_to_all(kinds, calibration, sensor, into.path, record, confirm, sinks, in_doubt)
        _report(calibration, writing, as_json)
    return RefusedError.exit_code if calibration.verdict == REFUSED else 0


def _opened(
    resume: Path | None, options: dict[str, Any], sinks: tuple[str, ...], no_write: bool, attended: bool
) -> tuple[OpenedSource, tuple[SinkKind, ...], dict[str, Any]]:
    """The source, the sinks that the result goes to, and the options that name the source."""
    if resume is None:
        # the write-back opens a simulated vehicle again, which then holds what it was given meanwhile
        options = {**options, "kept": {}}
        kinds = choose_sinks(sinks, no_write, check_source(click.get_current_context()))
        opening = {**options, "attended": attended, "writes": bool(kinds)}
        return open_source(opening, given()), kinds, options
    check_resume_options(given())
    check_unfinished(resume)
    source = open_resumed(resume)
    options = {**options, **source.live.words}
    return source, choose_sinks(sinks, no_write, matching_kinds(options)[0]), options


def _run(
    source: OpenedSource, folder: SessionFolder, person: Console, announcement: str, name: str | None
) -> tuple[Recording, Calibration, tuple[Path, ...]]:
    """Measure, calibrate, write the files; whatever ends it before, the capture is kept, and the person told where."""
    plan = source.plan
    fit = partial(calibrate_vehicle, model=plan.model, gravity=plan.gravity, gravity_anyway=plan.gravity_anyway)
    try:
        with running(source, folder.capture, person) as runner:
            if announcement:
                person.say(f"  {announcement}")
            try:
                recording = runner.measure()
            finally:
                folder.settle(runner.sensor)
            calibration = runner.calibrate(recording, fit)
            if name:
                calibration = replace(calibration, extra={**calibration.extra, NAME: name})
            return recording, calibration, runner.write(folder.path, calibration, recording, source.truth)
    except BaseException as error:
        if kept := folder.kept:
            person.say(f"  What was recorded is kept in {kept}{_how_to_go_on(source, kept.parent, error)}.")
        raise


def _how_to_go_on(source: OpenedSource, folder: Path, error: BaseException) -> str:
    """Who can resume is not told to start again: one advice, in the error where that has one."""
    if (folder / DOCUMENT.name).exists():
        return f", and the results in {folder}"
    if not source.resumable:
        return ""
    if not isinstance(error, MpucalError) or AGAIN not in error.remedy:
        return f"; go on with --resume {folder}"
    error.remedy = error.remedy.replace(AGAIN, f"go on with `mpucal session --resume {folder}`")
    return ""


def _report(calibration: Calibration, writing: Iterator[Applied], as_json: bool) -> None:
    """Write to the sinks, and say what was done; whatever becomes of that, there is a result."""
    try:
        for applied in writing:
            calibration = applied.calibration
            click.echo(f"Done: {applied.what}.", err=as_json)
    finally:
        if as_json:
            click.echo(calibration.json(), nl=False)
