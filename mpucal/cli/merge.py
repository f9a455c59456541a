"""`mpucal merge`: combine calibrations at different temperatures into one."""

from __future__ import annotations

from pathlib import Path

import click

from ..disk.atomic import check_not_input
from ..disk.output_folder import OutputFolder
from ..result.merge import merge
from ..result.session_files import BLOB, DOCUMENT
from ..session.results import calibration_files, check_owner, save
from .common import CALIBRATION_PATH, force_option, json_option, load_trusted, output_option, say
from .summary import slope, summary

EXAMPLE = "Example: `mpucal merge cold/calibration.json warm/calibration.json hot/calibration.json -o merged`"


@click.command("merge", epilog=EXAMPLE)
@click.argument("calibrations", metavar="A B ...", nargs=-1, type=CALIBRATION_PATH)
@output_option("folder", "DIR", "Folder for the result.")
@force_option
@json_option("Print only calibration.json.")
def command(calibrations: tuple[Path, ...], folder: Path | None, force: bool, as_json: bool) -> None:
    """Combine calibrations of one chip at different temperatures into one with b_a(T).

    If the data do not support b_a(T), b_a is their mean, and the reason is printed. `mpucal apply`, the blob and
    mpucal_apply.h use b_a(T).
    """
    if folder is not None:
        for file in (BLOB, DOCUMENT):
            check_not_input(folder / file.name, calibrations)
    made = merge([load_trusted(path, force) for path in calibrations])
    if folder is not None:
        check_owner(folder, made.calibration, None, "merge", *map(str, calibrations))
        with OutputFolder(folder) as into:
            save(into.path, calibration_files(made.calibration))
    for sentence in (made.why, *made.remarks):
        say(sentence)
    if as_json:
        click.echo(made.calibration.json(), nl=False)
        return
    click.echo(f"{summary(made.calibration)}\n{slope(made.calibration)}")
    if folder is not None:
        click.echo(f"\nWritten to {folder}:\n  {BLOB.name}, {DOCUMENT.name}")
