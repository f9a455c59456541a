"""The options of the commands that write to a sink, made from the table of sinks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

import click

from ..errors import UsageError
from ..sinks.choose import FILE, check_behind, default_sinks
from ..sinks.kind import Device, SinkKind
from ..sinks.table import SINKS
from ..sources.kind import SourceKind
from ..sources.opening import open_source
from ..sources.table import matching_kinds
from .person import say

F = TypeVar("F", bound=Callable[..., Any])


def session_sink_options(command: F) -> F:
    """--to and --no-write."""
    for option in (
        click.option("--no-write", is_flag=True, help="Write only files."),
        click.option(
            "--to",
            "sinks",
            type=click.Choice([FILE, *SINKS]),
            multiple=True,
            help=f"Where to write the result, may be repeated; {default_sinks()}.",
        ),
    ):
        command = option(command)
    return command


def sink_flags(command: F) -> F:
    """The options that belong to one kind of sink, such as --store."""
    for kind in SINKS.values():
        for flag in kind.flags:
            command = click.option(f"--{flag.name}", is_flag=True, help=f"{kind.name}: {flag.help}")(command)
    return command


def device(options: Mapping[str, Any]) -> Device:
    """The device that a command's source options name; its sinks' flags are among the options."""
    kind = matching_kinds(options)[0]
    flags = {flag.name for kind in SINKS.values() for flag in kind.flags}
    given = frozenset(name for name in flags if options.get(name))
    return Device(kind, str(options[kind.option.name]), partial(open_source, options), say, given, options)


def check_sink(kind: SinkKind, source: SourceKind, options: Mapping[str, Any]) -> None:
    """Refuse a sink that is not behind the source, and flags of another one.

    Raises
    ------
    UsageError : the options do not fit the sink.
    """
    check_behind(kind, source, f"{kind.name} was named")
    for other in SINKS.values():
        for flag in other.flags:
            if options.get(flag.name) and flag not in kind.flags:
                raise UsageError(f"--{flag.name} was given, and {kind.where} has no use for it", "leave it out")
