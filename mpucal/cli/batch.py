"""`mpucal batch`: calibrate many recordings at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import click

from ..batch.journal import Journal
from ..batch.many import JOURNAL, Progress, local_client, remote_client, run
from ..batch.paths import found
from ..batch.row import Settings
from ..disk.folder import Folder
from ..disk.whole import write_atomically
from ..errors import UsageError
from .options import fit_options
from .person import say
from .recording_options import hint_options, hints_by_pattern, hints_of

EXAMPLE = "Example: `mpucal batch 'line3/*.mcap' -o fleet --workers 1`"
EVERY_S = 2.0
REPORTS = "reports"


@click.command("batch", epilog=EXAMPLE)
@click.argument("files", metavar="FILE|GLOB|URL...", nargs=-1, required=True)
@click.option("-o", "folder", metavar="DIR", type=click.Path(path_type=Path), required=True, help="For the results.")
@click.option("--workers", metavar="N", type=click.IntRange(1), help="Processes on this machine; one a processor.")
@click.option("--scheduler", metavar="ADDRESS", help="A dask scheduler that runs already, tcp://HOST:PORT.")
@click.option("--dashboard", is_flag=True, help="Say where dask's dashboard is.")
@click.option("--reports", is_flag=True, help="Write a report of each, which the page links to.")
@click.option(
    "--hints",
    "by_pattern",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Lines of a pattern of files and options of those: `walk*.csv --units acc=g`.",
)
@fit_options
@hint_options()
def command(
    files: tuple[str, ...],
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    dashboard: bool,
    reports: bool,
    by_pattern: Path | None,
    gravity: float,
    gravity_anyway: bool,
    model: str,
    **hints: Any,
) -> int:
    """Calibrate many recordings: a table with a row for each, and a page about all of them.

    The same command again goes on where it was stopped; what is done is not done again.
    """
    if scheduler and workers:
        raise UsageError("--workers is for this machine, and --scheduler names another's", "give one of them")
    paths = found(files)
    settings = Settings(
        model,
        gravity,
        gravity_anyway,
        str((folder / REPORTS).resolve()) if reports else "",
        hints_of(hints),
        () if by_pattern is None else hints_by_pattern(by_pattern),
    )
    with (
        Folder(folder),
        Folder(folder / REPORTS) if reports else nullcontext(),
        closing(Journal(folder / JOURNAL, settings.key)) as journal,
    ):
        with remote_client(scheduler) if scheduler else local_client(workers, dashboard) as client:
            if dashboard:
                say(f"the dashboard is at {client.dashboard_link}")
            _follow(run(paths, client, journal, settings))
        _tell(folder, paths, journal)
    return 0


def _follow(progress: Iterator[Progress]) -> None:
    """Say how far it is, every two seconds and at the end."""
    said = time.monotonic()
    for each in progress:
        if time.monotonic() - said > EVERY_S or each.done == each.of:
            said = time.monotonic()
            say(_words(each))


def _words(progress: Progress) -> str:
    words = f"{progress.done} of {progress.of}"
    if made := progress.done - progress.kept:
        words += f", {made / progress.seconds:.3g} a second"
    if progress.left_s:
        words += f", {_duration(progress.left_s)} left"
    if progress.kept:
        words += f", {progress.kept} were there already"
    return words + (f", {progress.failed} unreadable" if progress.failed else "")


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _tell(folder: Path, paths: list[str], journal: Journal) -> None:
    # pyarrow is slow to load
    from ..batch.page import PAGE, page  # noqa: PLC0415
    from ..batch.table import write  # noqa: PLC0415

    parquet, text = write(folder, journal.rows(paths))
    fleet = page(parquet)
    write_atomically(folder / PAGE, fleet.html.encode())
    click.echo(f"{fleet.sentence}\n\nWritten to {folder}: {parquet.name}, {text.name}, {PAGE}")
