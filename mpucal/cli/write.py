"""`mpucal write`: write a calibration to the device that uses it, or restore the previous state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..data import STANDARD_GRAVITY_MPS2
from ..disk.folder import Folder
from ..sinks.record import file_recorder, is_calibration
from ..sinks.table import SINKS
from ..sinks.write_back import put_back, write_objection, write_to
from .destination import check_sink, device, sink_flags
from .loading import force_option, trusted
from .options import check_source, source_options
from .person import ask, say

EXAMPLE = "Example: `mpucal write board7/calibration.json chip --bus /dev/i2c-1`"


@click.command("write", epilog=EXAMPLE)
@click.argument("calibration", metavar="CALIBRATION", type=click.Path(path_type=Path))
@click.argument("to", metavar="|".join(SINKS), type=click.Choice(list(SINKS)))
@source_options("write")
@sink_flags
@click.option(
    "-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the saved previous state."
)
@click.option("--yes", is_flag=True, help="Ask no questions.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print only the calibration as it is applied now.")
def command(
    calibration: Path, to: str, folder: Path | None, yes: bool, force: bool, as_json: bool, **options: Any
) -> None:
    """Write a calibration (.json or .bin) to a device, read it back and check its effect.

    If a step fails, the previous state is restored. If CALIBRATION is a file in which an earlier write saved the
    previous state, that is restored. Exit code 6: refused or failed, nothing was changed.
    """
    kind = SINKS[to]
    check_sink(kind, check_source(click.get_current_context()), options)
    written = trusted(calibration, force) if is_calibration(calibration) else None
    # a simulated chip lives in the gravity in which it was calibrated
    gravity = STANDARD_GRAVITY_MPS2 if written is None else written.fit.get("gravity") or STANDARD_GRAVITY_MPS2
    with (
        Folder(folder or calibration.parent) as into,
        kind.open(device({**options, "gravity": gravity})) as sink,
    ):
        against = write_objection(written, sink) if written is not None and written.quality else None
        if against is not None:
            say(f"{against}.")
        ask(f"Write {calibration} to {sink.where}?", yes)
        if written is None:
            click.echo(f"Done: {put_back(kind, sink, calibration, into.path, say)}.")
            return
        path = into.path / kind.after_write(calibration.stem)
        applied = write_to(kind, sink, written, into.path, file_recorder(path), say)
    if as_json:
        click.echo(applied.calibration.json(), nl=False)
        return
    click.echo(f"Done: {applied.what}.")
    click.echo(f"Written to {path} (and .bin): the calibration of the sensor as it is now.")
