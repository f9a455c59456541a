"""`mpucal record`: record a sensor to a capture file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from ..disk.atomic import check_free
from ..errors import Abandoned, OutputError, SourceError
from ..result.clock import file_stamp
from ..sources.opening import open_source
from ..terminal.console import console
from ..terminal.hangup import logging_after_hangup
from .common import output_option
from .options import ABOVE_ZERO, fit_options, given_options
from .running import open_runner
from .source_options import check_source, source_options

MCAP = ".mcap"
EXAMPLE = "Example: `mpucal record --bus /dev/i2c-1 -o capture.mcap --seconds 60`"


@click.command("record", epilog=EXAMPLE)
@source_options("record")
@fit_options
@output_option("file", "FILE", "Capture file.")
@click.option("--seconds", type=ABOVE_ZERO, help="Stop after this time [s].")
def command(file: Path | None, seconds: float | None, **options: Any) -> None:
    """Record to a capture file until Enter, Ctrl-C or --seconds; `mpucal calibrate` reads it.

    The prompts are those of a session. --gravity and --model are stored for its replay.
    """
    check_source(click.get_current_context())
    source = open_source(options, given_options(), until_end=True)
    file = file or Path(f"record-{file_stamp()}{MCAP}")
    if file.suffix.lower() != MCAP:
        raise OutputError(f"{file} does not end with {MCAP}, by which other commands know a capture", f"add {MCAP}")
    check_free(file)
    person = console(quiet=False)
    with logging_after_hangup(lambda: file.with_suffix(".log"), partial(person.hung_up, stop=True)):
        with open_runner(source, file, person) as runner:
            try:
                samples = runner.record(seconds)
            except (SourceError, Abandoned) as error:
                error.what += f"; {file} has the {runner.samples} samples until then" if runner.samples else ""
                raise
            finally:
                # A sensor that never answered leaves no file, so that the next attempt can use its name.
                if runner.sensor is None:
                    file.unlink(missing_ok=True)
        click.echo(f"{file}: {samples} samples.")
