"""`mpucal show`: show the contents of a calibration, a recording or a device."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import click
import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Recording, Sensor
from ..errors import UsageError
from ..files import load
from ..files.formats import readable_formats, recognise
from ..files.hints import Hints
from ..rests.flat import find_flat
from ..result.blob import Blob
from ..result.calibration import Calibration
from ..result.journal import AT, Journal
from ..sinks.table import SINKS
from ..sources.kind import SourceKind
from ..sources.opening import contents, one_of
from ..sources.table import kinds_for, matching_kinds
from .loading import loaded
from .options import check_source, given, source_options
from .person import say
from .recording_options import NAMES, hint_options, hints_of, say_taken
from .summary import formula, slope, summary

EXAMPLE = "Example: `mpucal show calibration.json`, `mpucal show capture.mcap --json`, or `mpucal show --serial PORT`"
CALIBRATIONS = (".json", ".bin")


HELP = f"""Show a calibration (.json), a config blob (.bin), a recording, or what a device holds.

A recording is {readable_formats()}. Of a device, its registers, memory or
parameters are read; nothing is written.
"""


@click.command("show", help=HELP, epilog=EXAMPLE)
@click.argument("file", metavar="FILE|DIR", type=click.Path(path_type=Path), required=False)
@source_options("show", settings=False)
@hint_options()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(file: Path | None, as_json: bool, **options: Any) -> None:
    """Show the one place that is given."""
    sources = matching_kinds(options)
    places = [*(["a file"] if file is not None else []), *(kind.option.flag for kind in sources)]
    if len(places) != 1:
        raise UsageError(
            f"{' and '.join(places)} were given together" if places else "nothing to show was named",
            f"give a file, or {one_of(kinds_for('show'))}",
        )
    if file is None:
        if said := [spelled for name, spelled in given().items() if name in NAMES]:
            raise UsageError(f"{' and '.join(said)} say how a file is read, and a device was given", "leave them out")
        kept = {name: value for name, value in options.items() if name not in NAMES}
        _show_device(check_source(click.get_current_context()), kept, as_json)
    elif file.suffix in CALIBRATIONS and recognise(file) is None:
        _show_calibration(str(file), loaded(file), as_json)
    else:
        _show_recording(file, hints_of(options), as_json)


def _show_device(kind: SourceKind, options: Mapping[str, Any], as_json: bool) -> None:
    for sink in SINKS.values():
        left = Journal.of(sink.name, options[kind.option.name]).interrupted() if sink.behind(kind) else None
        if left is not None:
            say(
                f"a write to {sink.where} was cut off at {left[AT]}: it may hold old and new values;"
                f" the next `mpucal write CALIBRATION {sink.name} {kind.option.flag} ...` first restores the old"
            )
    if kind.store:
        with resolve_name(kind.store)(options) as store:
            number, blob = store.take()
            where = f"blob number {number} of the bridge on {store.name}"
            held = Blob.decode(blob)
            if held.gyro_counts is None:
                say(
                    f"{where} is of a version that does not say the unit of K: it is that of 131 counts to 1 deg/s at"
                    " ±250 deg/s, and rates from firmware of its time are 0.055 % too small; a newer one's are not"
                )
            _show_calibration(where, Calibration.from_blob(held), as_json)
        return
    from .show_device import page  # noqa: PLC0415 - a file needs no driver

    facts = contents(options)
    click.echo(json.dumps(facts, indent=2) if as_json else page(facts))


def _show_calibration(where: str, calibration: Calibration, as_json: bool) -> None:
    click.echo(calibration.json() if as_json else _calibration(where, calibration), nl=not as_json)


def _show_recording(file: Path, hints: Hints, as_json: bool) -> None:
    recording = load(file, hints)
    say_taken(recording.taken)
    if recording.recovered is not None:
        click.echo(f"mpucal: {recording.recovered}", err=True)
    facts = _facts(recording)
    click.echo(json.dumps(facts, indent=2) if as_json else _recording(file, facts))


def _calibration(where: str, calibration: Calibration) -> str:
    made = f", made {calibration.created}" if calibration.created else ""
    head = f"{where}: a calibration of {_chip(calibration.sensor)}{made}."
    return "\n".join([head, "", summary(calibration), "", formula(calibration), *_applied(calibration)])


def _applied(calibration: Calibration) -> list[str]:
    """Where it is applied already, and how it goes with the temperature; nothing of what nobody said."""
    said = []
    if np.any(calibration.applied_in_hardware):
        mg = ", ".join(f"{1000 * value / STANDARD_GRAVITY_MPS2:+.1f}" for value in calibration.applied_in_hardware)
        said.append(f"The chip's offset registers subtract ({mg}) mg of b_a, until its supply goes or it is reset.")
    said += [f"Written at {entry.get('at')}: {entry.get('what')}." for entry in calibration.extra.get("written", ())]
    if calibration.follows_temperature:
        said.append(slope(calibration))
    return ["", *said] if said else []


def _facts(recording: Recording) -> dict[str, Any]:
    """What a recording holds, in JSON's own types."""
    flat = recording.flat or find_flat(recording)
    temperature = recording.temperature_c[np.isfinite(recording.temperature_c)]
    if not len(temperature) and recording.sensor.temperature_c is not None:
        # of the accelerometer alone it is that of the start
        temperature = np.array([recording.sensor.temperature_c])
    return {
        "chip": _chip(recording.sensor),
        "accel_range_g": recording.sensor.accel_range_g,
        "gyro_range_dps": recording.sensor.gyro_range_dps,
        "imus": 1 + len(recording.others),
        "samples": len(recording),
        "seconds": float(recording.t[-1] - recording.t[0]),
        "rate_hz": recording.rate_hz,
        "gaps": int(recording.gap.sum()),
        "acc_clipped": int(recording.acc_clipped.sum()),
        "gyr_clipped": int(recording.gyr_clipped.sum()),
        "flat_s": None if flat is None else [float(recording.t[i] - recording.t[0]) for i in (flat[0], flat[1] - 1)],
        "magnitude_mps2": float(np.median(np.linalg.norm(recording.acc, axis=1))),
        "fastest_dps": float(np.degrees(np.abs(recording.gyr).max())) if np.isfinite(recording.gyr).all() else None,
        "temperature_c": [float(temperature.min()), float(temperature.max())] if len(temperature) else None,
    }


def _recording(file: Path, facts: dict[str, Any]) -> str:
    flat, warm = facts["flat_s"], facts["temperature_c"]
    ranges = [
        f"±{facts[key]:g} {unit}"
        for key, unit in (("accel_range_g", "g"), ("gyro_range_dps", "deg/s"))
        if facts[key] is not None
    ]
    rows = {
        "sensor": ", ".join(
            [facts["chip"], *ranges, *([f"the first of {n} IMUs"] if (n := facts["imus"]) > 1 else [])]
        ),
        "samples": f"{facts['samples']} in {facts['seconds']:.1f} s, at {facts['rate_hz']:.2f} Hz",
        "lost": f"{facts['gaps']} gaps" if facts["gaps"] else "none",
        "clipped": f"{facts['acc_clipped']} accelerometer, {facts['gyr_clipped']} gyroscope samples",
        "lies flat": "never" if flat is None else f"from {flat[0]:.1f} to {flat[1]:.1f} s",
        "median |a|": f"{facts['magnitude_mps2']:.3f} m/s²",
        "fastest turn": "not measured" if facts["fastest_dps"] is None else f"{facts['fastest_dps']:.0f} deg/s",
        "temperature": "unknown" if warm is None else f"{warm[0]:.1f} to {warm[1]:.1f} °C",
    }
    return "\n".join([f"{file}: a recording.", "", *(f"  {key:<14}{value}" for key, value in rows.items())])


def _chip(sensor: Sensor) -> str:
    if sensor.chip:
        return sensor.chip
    return "an unnamed sensor" if sensor.who_am_i is None else f"a sensor of WHO_AM_I 0x{sensor.who_am_i:02x}"
