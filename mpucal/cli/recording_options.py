"""Options that say of a recording what it does not say itself, and the sentence of what was taken."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from ..arguments import content
from ..errors import UsageError
from ..files.budget import MOST_MB, VARIABLE
from ..files.hints import Hints, parse_columns, parse_span, parse_units
from .options import ABOVE_ZERO, Parsed, given

F = TypeVar("F", bound=Callable[..., Any])
MOST_BYTES = 1 << 20
NAMES = {
    "topic": "topic",
    "columns": "columns",
    "units": "units",
    "accel_range": "accel_range_g",
    "gyro_range": "gyro_range_dps",
    "rate": "rate_hz",
    "span": "span",
}


def _allow(_context: click.Context, _option: click.Parameter, megabytes: int | None) -> None:
    if megabytes is not None:
        os.environ[VARIABLE] = str(megabytes)


_MOST = click.option(
    "--most-mb",
    metavar="MB",
    type=click.IntRange(1),
    expose_value=False,
    callback=_allow,
    help=f"Memory that reading may take; default: ${VARIABLE}, or {MOST_MB}.",
)


def hint_options(*left_out: str) -> Callable[[F], F]:
    """Options for all of NAMES, but for those that a command has already, and --most-mb."""
    options = {
        "topic": click.option(
            "--topic", metavar="NAME", help="Topic of a bag; two, the accelerometer's first: ONE,OTHER."
        ),
        "columns": click.option(
            "--columns",
            metavar="COLUMNS",
            type=Parsed(parse_columns),
            help="Columns of a table: t=NAME,ax=NAME,..., or their order: t,ax,ay,az,gx,gy,gz.",
        ),
        "units": click.option(
            "--units",
            metavar="UNITS",
            type=Parsed(parse_units),
            help="Units of a table or a bag: t=ms,acc=g,gyr=deg/s.",
        ),
        "accel_range": click.option("--accel-range", metavar="G", type=ABOVE_ZERO, help="Full scale of counts [g]."),
        "gyro_range": click.option(
            "--gyro-range", metavar="DPS", type=ABOVE_ZERO, help="Full scale of counts [deg/s]."
        ),
        "rate": click.option("--rate", metavar="HZ", type=ABOVE_ZERO, help="Rate of samples without times [Hz]."),
        "span": click.option(
            "--span",
            metavar="FROM:TO",
            type=Parsed(parse_span),
            help="Read this part of a recording alone: s since its first sample; one may be left out.",
        ),
    }

    def decorate(command: F) -> F:
        for name, option in reversed(options.items()):
            command = command if name in left_out else option(command)
        return _MOST(command)

    return decorate


def hints_of(options: Mapping[str, Any]) -> Hints:
    """What was said, of a command's options."""
    said = {attribute: options[name] for name, attribute in NAMES.items() if options.get(name) is not None}
    return Hints(**said)


def given_hints(options: Mapping[str, Any]) -> Hints:
    """The same of a command that also takes sources: how their sensor is set says of a file how counts were made."""
    said = given()
    values = {name: options[name] for name in NAMES if name in said}
    # a range is a number, which a source's option has as text
    ranges = {name: float(value) for name, value in values.items() if name in ("accel_range", "gyro_range")}
    return hints_of({**values, **ranges})


def hints_by_pattern(path: Path) -> tuple[tuple[str, Hints], ...]:
    """The hints of a file that has on each line a pattern of files' names and what is said of those; `#` begins a note.

    Raises
    ------
    UsageError : it cannot be read, or a line is none; it is named by its number.
    """
    try:
        lines = content(path, MOST_BYTES).decode().splitlines()
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is no text", "give a pattern and options on each line") from error
    found = []
    for number, line in enumerate(lines, 1):
        try:
            words = shlex.split(line, comments=True)
            if words:
                context = _HINTS.make_context("hints", words[1:])
                found.append((words[0], hints_of(context.params)))
        except (ValueError, click.ClickException) as error:
            said = error.format_message() if isinstance(error, click.ClickException) else str(error)
            raise UsageError(
                f"{path}: line {number} is no pattern with options ({said})", "write it as `walk*.csv --units acc=g`"
            ) from error
    return tuple(found)


@click.command(add_help_option=False)
@hint_options()
def _HINTS(**_hints: Any) -> None:  # noqa: N802 - a command, of which the options are read
    """Options that may follow a pattern on a line of hints."""


def say_taken(taken: str | None) -> None:
    """What a file's columns and units were taken for, where they had to be recognised."""
    if taken is not None:
        click.echo(f"mpucal: {taken}", err=True)
