"""Options that say of a recording what it does not say itself, and the sentence of what was taken."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

from ..files.budget import MOST_MB, VARIABLE
from ..files.hints import Hints, parse_columns, parse_units
from .options import ABOVE_ZERO, Parsed, given

F = TypeVar("F", bound=Callable[..., Any])
NAMES = {
    "topic": "topic",
    "columns": "columns",
    "units": "units",
    "accel_range": "accel_range_g",
    "gyro_range": "gyro_range_dps",
    "rate": "rate_hz",
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
    """--topic, --columns, --units, --accel-range, --gyro-range and --rate, but for those that a command has already."""
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


def say_taken(taken: str | None) -> None:
    """What a file's columns and units were taken for, where they had to be recognised."""
    if taken is not None:
        click.echo(f"mpucal: {taken}", err=True)
