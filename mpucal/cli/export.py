"""`mpucal export`: convert a calibration to the format of another program."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..disk.atomic import check_not_input, write_atomically
from ..errors import UsageError
from ..export.forms import FORMS, form
from ..result.noise import Noise, with_noise
from ..result.session_files import DOCUMENT
from .common import calibration_argument, json_option, load_calibration, noise_option, output_option, say

EXAMPLE = "Example: `mpucal export board7/calibration.json --to c-header -o calibration.h`"
# Not a form of a calibration, but of a vehicle's capture.
TLOG = "tlog"

# Backticks are Markdown's, for docs/use.md; \b keeps click from joining the lines.
_FORMS = [row.name for row in FORMS]
_ROWS = "\n".join(f"{row.name:<12}{row.read_by.replace('`', '')}" for row in FORMS)
HELP = f"""Convert a calibration (.json or .bin) to the format of another program, and say what is lost.

\b
{_ROWS}
{TLOG:<12}ground stations; of a vehicle's capture or session's folder in place of CALIBRATION

Exit code 5: the calibration was refused; 6: the format cannot represent it.
"""


@click.command("export", help=HELP, epilog=EXAMPLE)
@calibration_argument
@click.option("--to", "name", type=click.Choice([*_FORMS, TLOG]), required=True, help="Output format.")
@output_option("file", "FILE", "Output file; default: stdout.")
@noise_option
@json_option("Print format, text and what is lost as JSON.")
def command(calibration: Path, name: str, file: Path | None, noise: Path | None, as_json: bool) -> None:
    """Convert the calibration, and print or write the text."""
    if file is not None:
        check_not_input(file, [calibration])
    if name == TLOG:
        if file is None or noise is not None or as_json:
            raise UsageError("--to tlog writes packets", "name the file with -o, and leave out --noise and --json")
        from ..files.vehicle_logs import tlog_of  # noqa: PLC0415 - no other form reads a capture

        write_atomically(file, tlog_of(calibration.parent if calibration.name == DOCUMENT.name else calibration))
        click.echo(f"Written to {file}.")
        return
    chosen = form(name)
    read = load_calibration(calibration)
    text, notes = chosen.export(read if noise is None else with_noise(read, Noise.load(noise)))
    if file is not None:
        write_atomically(file, text.encode())
    for note in notes:
        say(note)
    if as_json:
        document = {"to": name, "ending": chosen.suffix, "text": text, "cannot_carry": notes}
        click.echo(json.dumps(document, indent=2))
    elif file is not None:
        click.echo(f"Written to {file}.")
    else:
        click.echo(text, nl=False)
