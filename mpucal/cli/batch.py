"""`mpucal batch`: calibrate many recordings at once."""

from __future__ import annotations

import glob
import shlex
import time
from collections.abc import Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import click

from ..batch.journal import RowJournal
from ..batch.locations import expand
from ..batch.many import JOURNAL, Progress, local_client, remote_client, run_batch
from ..batch.row import Settings
from ..disk.atomic import write_atomically
from ..disk.output_folder import OutputFolder
from ..errors import SourceError, UsageError
from ..result.clock import duration
from . import amended, typed_words
from .common import PATH, PROGRESS_S, output_option, say
from .options import fit_options
from .recording_options import hint_options, hint_words, make_hints, read_hints_file

EXAMPLE = "Example: `mpucal batch 'line3/*.mcap' -o fleet --workers 1`"
REPORTS, HINTS = "reports", "hints.txt"


@click.command("batch", epilog=EXAMPLE)
@click.argument("files", metavar="FILE|GLOB|URL...", nargs=-1, required=True)
@output_option("folder", "DIR", "Folder for the results.", required=True)
@click.option(
    "--workers", metavar="N", type=click.IntRange(1), help="Processes on this machine; default: one for each core."
)
@click.option("--scheduler", metavar="ADDRESS", help="Use a running dask scheduler, tcp://HOST:PORT.")
@click.option("--reports", is_flag=True, help="Write a report of each recording, linked from the page.")
@click.option(
    "--hints",
    "by_pattern",
    metavar="FILE",
    type=PATH,
    help="File with a pattern of file names and their options on each line: `walk*.csv --units acc=g`.",
)
@fit_options
@hint_options()
def command(
    files: tuple[str, ...],
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    reports: bool,
    by_pattern: Path | None,
    gravity: float,
    gravity_anyway: bool,
    model: str,
    **hints: Any,
) -> int:
    """Calibrate many recordings: a table with a row for each, and a page about all of them.

    A command that was stopped continues when it is given again: finished recordings are not calibrated twice.
    """
    if scheduler and workers:
        raise UsageError("--workers and --scheduler were given together", "give one of them")
    paths = expand(files)
    settings = Settings(
        model,
        gravity,
        gravity_anyway,
        str((folder / REPORTS).resolve()) if reports else "",
        make_hints(hints),
        () if by_pattern is None else read_hints_file(by_pattern),
    )
    with (
        OutputFolder(folder),
        OutputFolder(folder / REPORTS) if reports else nullcontext(),
        closing(RowJournal(folder / JOURNAL, settings.key)) as journal,
    ):
        with remote_client(scheduler) if scheduler else local_client(workers) as client:
            any_read = _follow(run_batch(paths, client, journal, settings))
        _write_results(folder, paths, journal)
        _say_options(folder, journal.rows(paths), settings, by_pattern)
    return 0 if any_read else SourceError.exit_code


def _follow(progress: Iterator[Progress]) -> bool:
    """Print the progress every two seconds and at the end; return True if any recording could be read."""
    said_s, any_read = time.monotonic(), False
    for each in progress:
        any_read = each.failed < each.done
        if time.monotonic() - said_s > PROGRESS_S or each.done == each.of:
            said_s = time.monotonic()
            say(_progress_text(each))
    return any_read


def _progress_text(progress: Progress) -> str:
    text = f"{progress.done} of {progress.of}"
    if made := progress.done - progress.kept:
        text += f", {made / progress.seconds:.3g} a second"
    if progress.left_s:
        text += f", {duration(progress.left_s)} left"
    if progress.kept:
        text += f", {progress.kept} done before"
    return text + (f", {progress.failed} unreadable" if progress.failed else "")


def _write_results(folder: Path, paths: list[str], journal: RowJournal) -> None:
    # PyArrow is slow to load.
    from ..batch.page import PAGE, make_page  # noqa: PLC0415
    from ..batch.table import write_tables  # noqa: PLC0415

    parquet, text = write_tables(folder, journal.rows(paths))
    page, sentence = make_page(parquet)
    write_atomically(folder / PAGE, page.encode())
    click.echo(f"{sentence}\n\nWritten to {folder}: {parquet.name}, {text.name}, {PAGE}")


def _say_options(folder: Path, rows: Iterator[dict[str, Any]], settings: Settings, given: Path | None) -> None:
    """Write a file of hints with the options that the errors of files name, and print the command that uses it."""
    lines = []
    for row in rows:
        if "options" in row:
            words = amended(["batch", *hint_words(settings.find_hints(row["path"]))], row["options"], "")
            lines.append(shlex.join([glob.escape(row["path"]), *words[1:]]))
    if lines:
        # the first pattern that matches counts; what a person wrote into the folder's file stays
        files = [file for file in (given, folder / HINTS) if file is not None and file.exists()]
        before = [line for file in files for line in file.read_text(encoding="utf-8").splitlines()]
        write_atomically(folder / HINTS, "\n".join([*dict.fromkeys([*lines, *before]), ""]).encode())
        again = shlex.join(amended(typed_words(), f"--hints {shlex.quote(str(folder / HINTS))}", ""))
        say(f"of the files that could not be read, {len(lines)} name options: try `mpucal {again}`")
