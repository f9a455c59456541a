"""Options for properties that a recording does not state itself, and the messages about how it was read."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..arguments import read_limited
from ..data import Recording
from ..errors import UsageError
from ..files.hints import Hints, parse_columns, parse_span, parse_units
from ..files.reading import MOST_MB, VARIABLE, allowed_bytes
from ..files.rows import Rows
from ..sources.kind import Option
from ..strict_json import MOST_BYTES
from .common import Decorator, say, together
from .options import ABOVE_ZERO, given_options, option_of


def _allow(_context: click.Context, _option: click.Parameter, megabytes: int | None) -> None:
    os.environ[VARIABLE] = str(megabytes or allowed_bytes() >> 20)


_MOST = click.option(
    "--most-mb",
    metavar="MB",
    type=click.IntRange(1),
    expose_value=False,
    callback=_allow,
    help=f"Limit of the memory for reading; default: ${VARIABLE}, or {MOST_MB}.",
)
# hint: its option
_OPTIONS = {
    "topic": Option("topic", "Topic of a bag, or two topics, the accelerometer's first: ONE,OTHER.", "NAME"),
    "sensor": Option(
        "sensor",
        "Sensor to read from a table of several, by its name in the lines or columns, such as 0x69 or IMU2.",
        "ID",
    ),
    "columns": Option(
        "columns",
        "Columns of a table: t=NAME,ax=NAME,..., or their order: t,ax,ay,az,gx,gy,gz.",
        "COLUMNS",
        parse_columns,
    ),
    "units": Option("units", "Units of a table or a bag: t=ms,acc=g,gyr=deg/s.", "UNITS", parse_units),
    "accel_range_g": Option("accel_range", "Full scale of counts [g].", "G", ABOVE_ZERO),
    "gyro_range_dps": Option("gyro_range", "Full scale of counts [deg/s].", "DPS", ABOVE_ZERO),
    "rate_hz": Option("rate", "Rate of samples without times [Hz].", "HZ", ABOVE_ZERO),
    "span": Option(
        "span",
        "Read only this part of a recording, in s since its first sample; FROM or TO may be left out.",
        "FROM:TO",
        parse_span,
    ),
}
# name of an option in a command: hint
NAMES = {option.name: hint for hint, option in _OPTIONS.items()}


def hint_options(*left_out: str) -> Decorator:
    """Return the options for all of NAMES but those `left_out`, which the command has already, and --most-mb."""
    return together(_MOST, *(option_of(each) for each in _OPTIONS.values() if each.name not in left_out))


def make_hints(options: Mapping[str, Any]) -> Hints:
    """Return the hints among a command's options."""
    return Hints(**{hint: options[name] for name, hint in NAMES.items() if options.get(name) is not None})


def given_hints(options: Mapping[str, Any]) -> Hints:
    """Return the hints on the command line of a command that also takes sources.

    The settings of a source's sensor, such as its ranges, then describe the recording.
    """
    given = given_options()
    values = {name: options[name] for name in NAMES if name in given}
    # The options of a source have ranges as text.
    ranges = {name: float(value) for name, value in values.items() if name in ("accel_range", "gyro_range")}
    return make_hints({**values, **ranges})


def hint_words(hints: Hints) -> list[str]:
    """Return the words of a command line that give these hints."""
    words = []
    for hint, option in _OPTIONS.items():
        if value := getattr(hints, hint):
            if isinstance(value, Mapping):
                # the places of columns count from 1
                items = ((of, at + 1 if isinstance(at, int) else at) for of, at in value.items())
                value = ",".join(f"{of}={at}" for of, at in items)
            if isinstance(value, tuple):
                value = ":".join(f"{at:g}" for at in value if at < math.inf) + ":" * (value[1] == math.inf)
            words += option.words(value)
    return words


def read_hints_file(path: Path) -> tuple[tuple[str, Hints], ...]:
    """Read pairs of a pattern of file names and its hints, one on each line; `#` begins a comment.

    Raises
    ------
    UsageError : the file cannot be read, or a line cannot be parsed; the message has its number.
    """
    try:
        lines = read_limited(path, MOST_BYTES).decode().splitlines()
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not a text file", "give a pattern and options on each line") from error
    found = []
    for number, line in enumerate(lines, 1):
        try:
            words = shlex.split(line, comments=True)
            if words:
                context = _HINTS.make_context("hints", words[1:])
                found.append((words[0], make_hints(context.params)))
        except (ValueError, click.ClickException) as error:
            why = error.format_message() if isinstance(error, click.ClickException) else str(error)
            what = f"{path}: line {number} is not a pattern with options ({why})"
            raise UsageError(what, "write it as `walk*.csv --units acc=g`") from error
    return tuple(found)


@click.command(add_help_option=False)
@hint_options()
def _HINTS(**_hints: Any) -> None:  # noqa: N802 - a command that only parses options
    """Parse the options after a pattern on a line of a hints file."""


def say_interpretation(read: Recording | Rows) -> None:
    """Print how a file was interpreted, if that had to be guessed, and what was read of a damaged one."""
    for remark in (read.taken, read.recovered):
        if remark is not None:
            say(remark)
