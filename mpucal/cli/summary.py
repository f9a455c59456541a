"""Summary of a calibration on the terminal: verdict, parameters in %, mg and deg, estimated error, files."""

from __future__ import annotations

import math
import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..chip.registers import ACCEL_RANGES_G, GYRO_RANGES_DPS
from ..data import AXES
from ..disk.output_folder import free_name
from ..mavlink.parameters.document import AUTOPILOT, NEW
from ..origin import Origin
from ..report.elements import as_float
from ..report.units import accelerometer, estimated_error
from ..result.calibration import GOOD, REFUSED, USABLE, Calibration
from ..result.error_model import mg_text
from ..result.keys import ACCELEROMETER_FORMULA
from ..result.session_files import BLOB, DOCUMENT, REPORT, is_unfinished
from ..sources.table import matching_kinds
from . import amended, typed_words, with_option

OUTPUT, NO_MEASUREMENT = "-o", frozenset({"--replay", "--resume"})
# For each reason that a larger range of the chip prevents: the range's option, its field of Sensor, and its values.
RANGES = {
    "gyro_clipped": ("--gyro-range", "gyro_range_dps", GYRO_RANGES_DPS),
    "accel_clipped": ("--accel-range", "accel_range_g", ACCEL_RANGES_G),
}

# Option in a remedy with its value; a placeholder in capitals is no value.
REMEDY_OPTION = re.compile(r"\bsay (--[a-z-]+ [^\s;A-Z]+?)(?=[\s;.]|,\s|$)")

# For a terminal of 80 columns.
WIDTH = 79
# what follows the verdict
ENDINGS = {GOOD: ".", USABLE: ", with reservations:", REFUSED: ":"}


def summary(calibration: Calibration) -> str:
    """Return the verdict with its reasons, the parameters with standard uncertainties, and the estimated error.

    Of further IMUs of a vehicle it has the verdicts with their reasons.
    """
    verdict, others = _verdict("The calibration", calibration.quality), calibration.extra.get("others") or ()
    lines = [*verdict, ""] if verdict else []
    # Scale factor error, bias and misalignment, one column an axis.
    rows = [
        (f"{_imu(calibration.extra)}, value ± 1 sigma" if others else "value ± 1 sigma", AXES),
        *((f"{row.name}, {row.unit}", row.cells) for row in accelerometer(calibration)),
    ]
    lines += [(f"{name:<23}" + "".join(f" {cell:>17}" for cell in cells)).rstrip() for name, cells in rows]
    if error := estimated_error(calibration):
        lines += ["", textwrap.fill(error, WIDTH)]
    for other in others:
        lines += ["", *_verdict(f"The calibration of {_imu(other)}", other.get("quality", {}))]
    return "\n".join([*lines, *describe_fit(calibration)])


def _verdict(what: str, quality: Mapping[str, Any]) -> list[str]:
    """Return the verdict on a calibration and its reasons; nothing if it was not judged."""
    if "verdict" not in quality:
        return []
    return [
        f"{what} is {quality['verdict']}{ENDINGS[quality['verdict']]}",
        *(
            textwrap.fill(f"  - {each['message']}.", WIDTH, subsequent_indent="    ")
            for each in quality.get("reasons", ())
        ),
    ]


def _imu(document: Mapping[str, Any]) -> str:
    return f"IMU {document.get('autopilot', {}).get('imu', 1)}"


def next_steps(
    calibration: Calibration,
    paths: Sequence[Path],
    recording: Path | None = None,
    source: Mapping[str, Any] | None = None,
) -> str:
    """Return the list of files that were written to `paths`, and what to do next; see command_again."""
    again = command_again(calibration, paths[0].parent if paths else None, recording, source or {})
    how = f"run\n  {again}" if again else "give the same command again."
    refused = f"Next: {_follow_the_remedy(again, recording)}, and {how}"
    if not paths:
        return refused if calibration.verdict == REFUSED else ""
    folder = paths[0].parent
    lines = [f"Written to {folder}:", "  " + ", ".join(path.name for path in paths)]
    if all(path.name != BLOB.name for path in paths):
        return "\n".join([*lines, f"Look at {folder / REPORT.name}.", "", refused])
    lines += [
        "Next:",
        f"  look at      {folder / REPORT.name}",
        f'  in Python    a = mpucal.Calibration.load("{folder / DOCUMENT.name}").apply(acc)',
    ]
    # A session writes to its vehicle itself.
    if not (AUTOPILOT in calibration.extra and source):
        lines.append(use_in_device(calibration, folder))
    if calibration.verdict == USABLE:
        lines.append(f"  better       follow the remedies above, and run {again or 'it again'}")
    return "\n".join(lines)


def _follow_the_remedy(again: str, recording: Path | None) -> str:
    """Return the words before the command `again`; if it does not read `recording`, a new one is to be made first."""
    words = shlex.split(again)
    made = recording is None or words[1:2] == ["session"] or any(Path(word) == recording for word in words)
    return f"follow the remedy above{'' if made else ' in a new recording'}"


def use_in_device(calibration: Calibration, folder: Path) -> str:
    """Return how to write the calibration in `folder` to its device, or why that is not possible."""
    autopilot = calibration.extra.get(AUTOPILOT)
    if autopilot is None:
        return f"  in firmware  {folder / BLOB.name} (format: firmware_protocol.md)"
    if autopilot.get(NEW):
        return f"  in a vehicle mpucal write {folder / DOCUMENT.name} autopilot --mavlink URL"
    return f"  in a vehicle it cannot be written: {autopilot.get('why', 'its parameters are not known')}"


def command_again(
    calibration: Calibration, folder: Path | None, recording: Path | None, source: Mapping[str, Any]
) -> str:
    """Return the command line that was typed, as it is for another measurement; empty if it is the same.

    The results get a free name, and so does `recording`, unless a remedy says how to read it. A range that clipped the
    data is replaced by the next larger one. A replay and a resumed session cannot be measured again: a new session can,
    on the same source if that is known by the options `source` (see Request.words). An interrupted session continues.
    """
    if recording is not None and is_unfinished(recording):
        return f"mpucal {shlex.join(['session', '--resume', str(recording)])}"
    typed = typed_words()
    words = _session_words(source) if NO_MEASUREMENT.intersection(typed) else list(typed)
    reasons = calibration.quality.get("reasons", ())
    suggested = REMEDY_OPTION.search(" ".join(reason.get("remedy", "") for reason in reasons))
    if recording is not None and suggested:
        words = amended(words, suggested[1], "")
    elif recording is not None:
        free = str(free_name(recording.parent / recording.stem, recording.suffix))
        words = [free if Path(word) == recording else word for word in words]
    elif calibration.sensor.origin is Origin.CHIP:
        codes = {reason["code"] for reason in reasons}
        for option, key, ranges in (row for code, row in RANGES.items() if code in codes):
            larger = [each for each in ranges if each > (getattr(calibration.sensor, key) or math.inf)]
            words = with_option(words, option, str(larger[0])) if larger else words
    if OUTPUT in words and folder is not None:
        words = with_option(words, OUTPUT, str(free_name(folder)))
    return "" if words == typed else f"mpucal {shlex.join(words)}"


def _session_words(source: Mapping[str, Any]) -> list[str]:
    """Return the words of a command line for a session on a source."""
    words = ["session"]
    for option in (each for kind in matching_kinds(source) for each in (kind.option, *kind.options)):
        if (value := source.get(option.name)) is not None:
            words += option.words(value)
    return words


def formula(calibration: Calibration) -> str:
    """Return the formula of the calibrated acceleration with its numbers."""
    rows = [
        f"  [{' '.join(f'{value:+.6f}' for value in row)}]   y_{axis} {-bias:+.5f}"
        for axis, row, bias in zip(AXES, calibration.inverse, calibration.b_a_to_subtract, strict=True)
    ]
    return "\n".join([f"{ACCELEROMETER_FORMULA} [m/s²]", *rows])


def slope(calibration: Calibration) -> str:
    """Return b_a(T) as a sentence."""
    if not calibration.follows_temperature:
        return "b_a is assumed to be the same at every temperature."
    low, high = calibration.temperature_range_c
    return (
        f"b_a changes by ({mg_text(calibration.b_a_slope, 3)}) mg/°C, relative to"
        f" {calibration.sensor.temperature_c:.1f} °C, between {low:.1f} and {high:.1f} °C."
    )


def describe_fit(calibration: Calibration) -> list[str]:
    """Return the model, what it was fitted to, and gravity, after an empty line; nothing if there was no fit."""
    fit = calibration.fit
    if "samples" not in fit:
        return []
    return [
        "",
        f"Model {fit.get('model')}: {fit['samples']} samples in {as_float(fit.get('seconds')):.1f} s,"
        f" gravity {as_float(fit.get('gravity')):.5f} m/s².",
    ]
