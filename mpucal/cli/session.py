"""`mpucal session`: guide a person, calibrate, and leave the results in a folder."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..data import Recording
from ..errors import MpucalError, RefusedError
from ..mavlink.parameters.document import calibrate_vehicle
from ..page.address import Address
from ..result.calibration import REFUSED, Calibration
from ..result.clock import warn_unset
from ..result.session_files import DOCUMENT, LOG
from ..session.aims import AIMS, NORMAL
from ..session.results import SessionFolder, check_unfinished, result_files
from ..sinks.choose import announce_sinks, choose_sinks, interrupted_writes
from ..sinks.kind import SinkKind
from ..sinks.write_back import session_recorder
from ..sources.kind import NAME
from ..sources.opened_source import OpenedSource
from ..sources.opening import check_resume_options, open_source
from ..sources.table import matching_kinds
from ..terminal.console import Console, sentence
from ..terminal.hangup import logging_after_hangup
from .common import PATH, json_option, output_option, say, yes_option
from .destination import session_sink_options, write_back
from .options import check_gravity, fit_options, given_options
from .page import BOARD_KIND, page_options, page_result, show_session
from .running import open_runner
from .source_options import check_source, source_options
from .summary import next_steps, summary

# Words of remedies that are replaced where the session can be resumed.
START_AGAIN = "start again"
EXAMPLE = "Example: `mpucal session --bus /dev/i2c-1 -o board7`; without a board, `mpucal session --bus sim`"
TARGET = AIMS[NORMAL].target


@click.command("session", epilog=EXAMPLE)
@source_options("session")
@fit_options
@click.option(
    "--target",
    type=click.Choice(tuple(AIMS)),
    default=NORMAL,
    show_default=True,
    help=f"Required accuracy (1 sigma): {NORMAL} is {TARGET.bias_mg:g} mg of bias, {TARGET.gain_pct:g} % of scale"
    f" factor error, {TARGET.misalignment_deg:g} deg of misalignment.",
)
@click.option(
    "--tilt-only",
    is_flag=True,
    help="For boards that cannot be turned upside down: use tilts only; parameters that tilts do not show keep "
    "their defaults.",
)
@session_sink_options
@output_option("folder", "DIR", "Folder for the results.")
@click.option("--resume", metavar="DIR", type=PATH, help="Continue the interrupted session in DIR.")
@click.option("--name", metavar="BOARD", help="Name of the board, for the screen, the page and the report.")
@yes_option
@json_option("Print only calibration.json.")
@click.option("--json-events", is_flag=True, help="Print each event as a line of JSON on stderr.")
@page_options
@click.option("--page-keys", is_flag=True, help="Accept Enter, r and q from the page as well.")
@click.option("--beep/--no-beep", default=None, help="Ring the bell at each new prompt; default: on a terminal.")
@click.option("--keep-going", is_flag=True, help="Continue if the terminal is closed, as by a dropped ssh connection.")
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
    source, kinds, options = _open(resume, {**options, NAME: name, BOARD_KIND: board}, sinks, no_write, attended)
    name = name or options.get(NAME)
    terminal, shown = show_session(source, options, page, board, yes, name, beep, json_events, page_keys)
    hung_up = partial(terminal.hung_up, stop=page is None and not keep_going)
    with (
        SessionFolder(resume or folder, source.capture_name, again=resume is not None) as into,
        logging_after_hangup(lambda: into.path / LOG.name, hung_up),
        shown as (person, show_result),
    ):
        # A program that reads the events finds the sinks in calibration.json.
        announcements = [] if json_events else [announce_sinks(kinds, no_write), warn_unset()]
        if resume is None:
            cut_off = interrupted_writes(check_source(click.get_current_context()), options)
            announcements += map(sentence, cut_off)
        announcement = " ".join(filter(None, announcements))
        recording, calibration, paths = _run(source, into, person, announcement, name)
        files = [into.capture, *paths]
        show_result(page_result(calibration), files)
        if not as_json:
            if not json_events:
                click.echo(err=True)
            click.echo(f"{summary(calibration)}\n\n{next_steps(calibration, files, source=source.words)}")
        record = session_recorder(into.path, calibration, recording, source.truth())
        device = {**options, "gravity": source.plan.gravity, "model": source.plan.model}
        latest = calibration
        # Whatever happens to the writing, there is a result to print.
        try:
            # A program that reads the events gets these sentences as events, too.
            tell = person.say if json_events else say
            for applied in write_back(kinds, calibration, device, into.path, record, sinks, yes, as_json, tell):
                latest = applied.calibration
        finally:
            if as_json:
                click.echo(latest.json(), nl=False)
    return RefusedError.exit_code if calibration.verdict == REFUSED else 0


def _open(
    resume: Path | None, options: dict[str, Any], sinks: tuple[str, ...], no_write: bool, attended: bool
) -> tuple[OpenedSource, tuple[SinkKind, ...], dict[str, Any]]:
    """Return the open source, the sinks for the result, and the options that name the source."""
    if resume is None:
        # A simulated vehicle keeps its parameters here until the write-back opens it again.
        options = {**options, "kept": {}}
        kinds = choose_sinks(sinks, no_write, check_source(click.get_current_context()))
        opening = {**options, "attended": attended, "writes": bool(kinds)}
        return open_source(opening, given_options()), kinds, options
    check_resume_options(given_options())
    check_unfinished(resume)
    from ..sources.replayed import open_resumed  # noqa: PLC0415 - it loads all that reads captures

    source = open_resumed(resume)
    options = {**options, **source.words}
    return source, choose_sinks(sinks, no_write, matching_kinds(options)[0]), options


def _run(
    source: OpenedSource, folder: SessionFolder, person: Console, announcement: str, name: str | None
) -> tuple[Recording, Calibration, tuple[Path, ...]]:
    """Measure, calibrate, write the files; if that fails, say where the capture is kept."""
    plan = source.plan
    fit = partial(calibrate_vehicle, model=plan.model, gravity=plan.gravity, gravity_anyway=plan.gravity_anyway)
    try:
        with open_runner(source, folder.capture, person) as runner:
            if announcement:
                person.say(f"  {announcement}")
            try:
                recording = runner.measure()
            finally:
                folder.settle(runner.sensor)
            calibration = runner.calibrate(recording, fit)
            if name:
                calibration = replace(calibration, extra={**calibration.extra, NAME: name})
            files = result_files(calibration, recording, source.truth())
            return recording, calibration, runner.write(folder.path, files)
    except BaseException as error:
        if kept := folder.kept:
            person.say(f"  The capture is kept in {kept}{_how_to_continue(source, kept.parent, error)}.")
        raise


def _how_to_continue(source: OpenedSource, folder: Path, error: BaseException) -> str:
    """Return how to resume; an error that says "start again" gets that advice in its remedy instead."""
    if (folder / DOCUMENT.name).exists():
        return f", and the results in {folder}"
    if not source.words:
        return ""
    if not isinstance(error, MpucalError) or START_AGAIN not in error.remedy:
        return f"; continue with --resume {folder}"
    error.remedy = error.remedy.replace(START_AGAIN, f"continue with `mpucal session --resume {folder}`")
    return ""
