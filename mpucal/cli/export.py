"""`mpucal export`: convert a calibration to the format of another program."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..disk.atomic import check_not_input, write_atomically
from ..export.forms import FORMS, form
from ..result.noise import Noise, with_noise
from .arguments import calibration_argument, json_option, noise_option, output_option
from .loading import load_calibration

EXAMPLE = "Example: `mpucal export board7/calibration.json --to c-header -o calibration.h`"


# Backticks are Markdown's, for docs/use.md; \b keeps click from joining the lines.
_ROWS = "\n".join(f"{row.name:<12}{row.read_by.replace('`', '')}" for row in FORMS)
HELP = f"""Convert a calibration (.json or .bin) to the format of another program, and say what is lost.

\b
{_ROWS}

Exit code 5: the calibration was refused; 6: the format cannot represent it.
"""


@click.command("export", help=HELP, epilog=EXAMPLE)
@calibration_argument
@click.option("--to", "name", type=click.Choice([row.name for row in FORMS]), required=True, help="Output format.")
@output_option("file", "FILE", "Output file; default: stdout.")
@noise_option
@json_option("Print format, text and what is lost as JSON.")
def command(calibration: Path, name: str, file: Path | None, noise: Path | None, as_json: bool) -> None:
    """Convert the calibration, and print or write the text."""
    if file is not None:
        check_not_input(file, [calibration])
    chosen = form(name)
    read = load_calibration(calibration)
    text, notes = chosen.export(read if noise is None else with_noise(read, Noise.load(noise)))
    if file is not None:
        write_atomically(file, text.encode())
    for note in notes:
        click.echo(f"mpucal: {note}", err=True)
    if as_json:
        document = {"to": name, "ending": chosen.suffix, "text": text, "cannot_carry": notes}
        click.echo(json.dumps(document, indent=2))
    elif file is not None:
        click.echo(f"Written to {file}.")
    else:
        click.echo(text, nl=False)
