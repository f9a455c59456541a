"""`mpucal calibrate`: calibrate from a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..disk.output_folder import OutputFolder
from ..errors import RefusedError
from ..files import load
from ..files.formats import readable_formats
from ..mavlink.parameters.document import calibrate_vehicle
from ..result.calibration import REFUSED
from ..result.noise import Noise, with_noise
from ..result.session_files import BLOB
from ..session.results import check_owner, result_files, save
from .common import PATH, json_option, noise_option, output_option, say
from .options import fit_options
from .recording_options import hint_options, make_hints, say_interpretation
from .summary import next_steps, summary

EXAMPLE = "Example: `mpucal calibrate capture.mcap -o results` or `mpucal calibrate walk.npz --json`"


HELP = f"""Calibrate from {readable_formats()}.

Exit code 5: the calibration was refused, with reasons.
"""


@click.command("calibrate", help=HELP, epilog=EXAMPLE)
@click.argument("recording", metavar="FILE|DIR", type=PATH)
@output_option("folder", "DIR", "Folder for the results.")
@json_option("Print only calibration.json.")
@noise_option
@fit_options
@hint_options()
def command(
    recording: Path,
    folder: Path | None,
    as_json: bool,
    noise: Path | None,
    gravity: float,
    gravity_anyway: bool,
    model: str,
    **hints: Any,
) -> int:
    """Calibrate from a recording, and print or write the result."""
    samples = load(recording, make_hints(hints))
    say_interpretation(samples)
    known = None if noise is None else Noise.load(noise)
    if known is not None:
        samples = replace(samples, sensor=known.at_least(samples.sensor, samples.rate_hz))
    calibration = calibrate_vehicle(samples, model=model, gravity=gravity, gravity_anyway=gravity_anyway)
    calibration = calibration if known is None else with_noise(calibration, known)
    paths: tuple[Path, ...] = ()
    if folder is not None:
        check_owner(folder, calibration, recording, "calibrate", str(recording))
        with OutputFolder(folder) as into:
            paths = save(into.path, dict(result_files(calibration, samples)))
    if as_json:
        click.echo(calibration.json(), nl=False)
    else:
        click.echo(summary(calibration))
        if steps := next_steps(calibration, paths, recording):
            click.echo(f"\n{steps}")
    if calibration.verdict != REFUSED:
        return 0
    if folder is not None and (folder / BLOB.name).exists():
        say(f"{folder / BLOB.name} is that of an earlier calibration; it was not changed.")
    return RefusedError.exit_code
