"""`mpucal write`: write a calibration to the device that uses it, or restore the previous state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..disk.output_folder import OutputFolder
from ..sinks.choose import check_has_sink
from ..sinks.table import SINKS
from ..sinks.write_back import file_recorder, is_calibration, put_back, write_objection, write_to
from .common import (
    ask,
    at_gravity_of,
    calibration_argument,
    force_option,
    json_option,
    load_trusted,
    output_option,
    say,
    say_done,
    yes_option,
)
from .destination import make_device
from .source_options import check_source, source_options

EXAMPLE = "Example: `mpucal write board7/calibration.json chip --bus /dev/i2c-1`"


@click.command("write", epilog=EXAMPLE)
@calibration_argument
@click.argument("to", metavar="|".join(SINKS), type=click.Choice(list(SINKS)))
@source_options("write")
@output_option("folder", "DIR", "Folder for the saved previous state.")
@yes_option
@force_option
@json_option("Print only the calibration as it is applied now.")
def command(
    calibration: Path, to: str, folder: Path | None, yes: bool, force: bool, as_json: bool, **options: Any
) -> None:
    """Write a calibration (.json or .bin) to a device, read it back and check its effect.

    If a step fails, the previous state is restored. To restore it later, give as CALIBRATION the file in which the
    write saved it. Exit code 6: refused or failed, nothing was changed.
    """
    kind = SINKS[to]
    check_has_sink(kind, check_source(click.get_current_context()), f"{kind.name} was named")
    written = load_trusted(calibration, force) if is_calibration(calibration) else None
    with (
        OutputFolder(folder or calibration.parent) as into,
        kind.open(make_device(at_gravity_of(written, options), yes)) as sink,
    ):
        objection = write_objection(written, sink) if written is not None else None
        if objection is not None:
            say(f"{objection}.")
        ask(f"Write {calibration} to {sink.where}?", yes)
        if written is None:
            say_done([put_back(kind, sink, calibration, into.path, say)])
            return
        path = into.path / kind.after_write(calibration.stem)
        applied = write_to(kind, sink, written, into.path, file_recorder(path), say)
    if as_json:
        click.echo(applied.calibration.json(), nl=False)
        return
    say_done(applied.clauses)
    click.echo(f"Written to {path} (and .bin): the calibration of its readings after this write.")
