"""`mpucal show`: show the contents of a calibration, a recording or a device."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import click
import numpy as np

from ..data import Recording, Sensor
from ..errors import UsageError
from ..files import load
from ..files.formats import readable_formats, recognise
from ..files.hints import Hints
from ..files.reading import first_bytes
from ..mavlink.parameters.slots import all_slots
from ..rests.flat import find_flat
from ..result.blob import MAGIC, Blob
from ..result.calibration import Calibration
from ..result.error_model import mg_text
from ..sinks.choose import interrupted_writes
from ..sources.kind import SourceKind
from ..sources.opening import open_source
from .common import PATH, json_option, load_calibration, say
from .options import given_options
from .recording_options import NAMES, hint_options, make_hints, say_interpretation
from .source_options import check_input, check_source, source_options
from .summary import formula, slope, summary

EXAMPLE = "Example: `mpucal show calibration.json`, `mpucal show capture.mcap --json`, or `mpucal show --serial PORT`"

HELP = f"""Show a calibration (.json), a config blob (.bin), a recording, or what a device holds.

A recording is {readable_formats()}. Of a device, its registers, memory or
parameters are read; nothing is written.
"""


@click.command("show", help=HELP, epilog=EXAMPLE)
@click.argument("file", metavar="FILE|DIR", type=PATH, required=False)
@source_options("show", settings=False)
@hint_options()
@json_option("Print JSON.")
def command(file: Path | None, as_json: bool, **options: Any) -> None:
    """Show the file or the device that is given."""
    check_input(file, options, "show")
    if file is None:
        if hints := [spelling for name, spelling in given_options().items() if name in NAMES]:
            raise UsageError(f"{' and '.join(hints)} say how a file is read, and a device was given", "leave them out")
        kept = {name: value for name, value in options.items() if name not in NAMES}
        _show_device(check_source(click.get_current_context()), kept, as_json)
    elif (file.suffix.lower() == ".json" or first_bytes(file).startswith((MAGIC, b"{"))) and recognise(file) is None:
        _show_calibration(str(file), load_calibration(file), as_json)
    else:
        _show_recording(file, make_hints(options), as_json)


def _show_device(kind: SourceKind, options: Mapping[str, Any], as_json: bool) -> None:
    for left in interrupted_writes(kind, options):
        say(left)
    if kind.store:
        with resolve_name(kind.store)(options) as store:
            number, blob = store.take()
            where = f"blob number {number} of the bridge on {store.name}"
            _show_calibration(where, Calibration.from_blob(Blob.decode(blob)), as_json)
        return
    facts = open_source(options).contents()
    click.echo(json.dumps(facts, indent=2) if as_json else _device_page(facts))


def _show_calibration(where: str, calibration: Calibration, as_json: bool) -> None:
    click.echo(calibration.json() if as_json else _calibration_page(where, calibration), nl=not as_json)


def _show_recording(file: Path, hints: Hints, as_json: bool) -> None:
    recording = load(file, hints)
    say_interpretation(recording)
    facts = _facts(recording)
    click.echo(json.dumps(facts, indent=2) if as_json else _recording_page(file, facts))


def _calibration_page(where: str, calibration: Calibration) -> str:
    made = f", made {calibration.created}" if calibration.created else ""
    head = f"{where}: a calibration of {_sensor_name(calibration.sensor)}{made}."
    return "\n".join([head, "", summary(calibration), "", formula(calibration), *_where_applied(calibration)])


def _where_applied(calibration: Calibration) -> list[str]:
    """Return lines about hardware offsets, write-backs and the temperature model, if present."""
    lines = []
    if np.any(calibration.applied_in_hardware):
        mg = mg_text(calibration.applied_in_hardware, 1)
        lines.append(f"The chip's offset registers subtract ({mg}) mg of b_a, until a power cycle or reset.")
    lines += [f"Written at {entry.get('at')}: {entry.get('what')}." for entry in calibration.extra.get("written", ())]
    if calibration.follows_temperature:
        lines.append(slope(calibration))
    return ["", *lines] if lines else []


def _facts(recording: Recording) -> dict[str, Any]:
    """Return the properties of a recording, in JSON's own types."""
    flat = recording.flat or find_flat(recording)
    temperature = recording.temperature_c[np.isfinite(recording.temperature_c)]
    return {
        "chip": _sensor_name(recording.sensor),
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


def _recording_page(file: Path, facts: dict[str, Any]) -> str:
    flat, celsius = facts["flat_s"], facts["temperature_c"]
    ranges = (("accel_range_g", "g"), ("gyro_range_dps", "deg/s"))
    sensor = [facts["chip"], *(f"±{facts[key]:g} {unit}" for key, unit in ranges if facts[key] is not None)]
    if facts["imus"] > 1:
        sensor.append(f"the first of {facts['imus']} IMUs")
    rows = {
        "sensor": ", ".join(sensor),
        "samples": f"{facts['samples']} in {facts['seconds']:.1f} s, at {facts['rate_hz']:.2f} Hz",
        "lost": f"{facts['gaps']} gaps" if facts["gaps"] else "none",
        "clipped": f"{facts['acc_clipped']} accelerometer, {facts['gyr_clipped']} gyroscope samples",
        "lies flat": "never" if flat is None else f"from {flat[0]:.1f} to {flat[1]:.1f} s",
        "median |a|": f"{facts['magnitude_mps2']:.3f} m/s²",
        "fastest turn": "not measured" if facts["fastest_dps"] is None else f"{facts['fastest_dps']:.0f} deg/s",
        "temperature": "unknown" if celsius is None else f"{celsius[0]:.1f} to {celsius[1]:.1f} °C",
    }
    return "\n".join([f"{file}: a recording.", "", *(f"  {key:<14}{value}" for key, value in rows.items())])


def _sensor_name(sensor: Sensor) -> str:
    if sensor.chip:
        return sensor.chip
    return "an unnamed sensor" if sensor.who_am_i is None else f"a sensor with WHO_AM_I 0x{sensor.who_am_i:02x}"


def _device_page(facts: Mapping[str, Any]) -> str:
    """Return the page of a device's registers or parameters; see OpenedSource.contents."""
    rows = _vehicle_rows(facts) if "parameters" in facts else _chip_rows(facts) if "who_am_i" in facts else dict(facts)
    rows.pop("where", None)
    width = max([18, *(len(key) + 2 for key in rows)])
    return "\n".join([f"{facts['where']}, as it is now.", "", *(f"  {key:<{width}}{rows[key]}" for key in rows)])


def _vehicle_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    values, slots = facts["parameters"], all_slots(facts["firmware"])
    corrected = [name for of in slots for name in of.names if values.get(name, name in of.scale) != (name in of.scale)]
    holds = f"a correction in {len(corrected)} parameters" if corrected else "no correction of its accelerometers"
    return {"holds": holds, **{name: f"{value:.8g}" for name, value in values.items()}}


def _chip_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    name = facts["chip"] or "unknown chip"
    rows = {
        "chip": f"{name}, WHO_AM_I 0x{facts['who_am_i']:02x}{', asleep' if facts['asleep'] else ''}",
        "ranges": f"±{facts['accel_range_g']} g, ±{facts['gyro_range_dps']} deg/s",
    }
    for address, words in facts["accel_offsets"].items():
        rows[f"offsets at {address}"] = ", ".join(map(str, words))
    if "acc_mps2" in facts:
        acc = facts["acc_mps2"]
        rows["measures"] = f"({', '.join(f'{a:+.3f}' for a in acc)}) m/s², |a| {np.linalg.norm(acc):.3f}"
        rows["temperature"] = f"{facts['temperature_c']:.1f} °C"
    return rows
