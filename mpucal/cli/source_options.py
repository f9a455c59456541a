"""Options of the sources, and checks of their combinations."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..errors import UsageError
from ..sources import opening
from ..sources.kind import SourceKind
from ..sources.table import SOURCES, kinds_for, matching_kinds, unique
from . import typed_words
from .common import Decorator, together
from .options import given_options, option_of


def source_options(name: str, settings: bool = True) -> Decorator:
    """Return the options of the sources that the command `name` takes; those of other sources are hidden.

    Hidden options are parsed, so that they are refused with a reason.

    Parameters
    ----------
    settings : add the settings of the sensor, too.
    """
    taken = kinds_for(name)
    belonging = [option for kind in taken for option in kind.options]
    if settings:
        belonging += [option for kind in taken for option in kind.settings]
    declared = []
    for option in unique(kind.option for kind in SOURCES):
        forms = [kind.forms for kind in taken if kind.option is option]
        declared.append(option_of(option._replace(help=_sentence(", or ".join(forms))), hidden=not forms))
    declared += map(option_of, unique(belonging))
    return together(*declared)


def _sentence(words: str) -> str:
    """Return a sentence; a form such as udp:PORT keeps its small letter, as it is typed."""
    first, _, _ = words.partition(" ")
    return f"{words if ':' in first else words[:1].upper() + words[1:]}."


def check_input(file: Path | None, options: Mapping[str, Any], name: str) -> list[SourceKind]:
    """Return the kinds of sources that are given; UsageError unless it is either a file or one source.

    Parameters
    ----------
    name : of the command.
    """
    kinds = matching_kinds(options)
    given = [*(["a file"] if file is not None else []), *(kind.option.flag for kind in kinds)]
    if len(given) != 1:
        what = f"{' and '.join(given)} were given together" if given else "neither a file nor a source was given"
        raise UsageError(what, f"give a file, or {opening.one_of(kinds_for(name))}")
    return kinds


def check_source(context: click.Context) -> SourceKind:
    """Return the kind of the source that is given; see sources.opening.

    Raises
    ------
    UsageError : no source or several were given, or an option does not belong to it.
    """
    command = str(context.command.name)
    if not matching_kinds(context.params) and not context.params.get("json_events"):
        _list_sources(command, shlex.join(typed_words()))
    return opening.check_source(context.params, given_options(), command)


def _list_sources(command: str, words: str) -> None:
    """Print the sources that there are, and the simulated chip, each with the whole command that takes it."""
    found = opening.found_sources(command)
    heading = "Found on this computer:" if found else "No sensor was found on this computer. To try it without:"
    click.echo(heading, err=True)
    lines = [(f"mpucal {words} {option}", what) for option, what in (*found, ("--bus sim", "the simulated chip"))]
    width = max(len(line) for line, _ in lines)
    for line, what in lines:
        click.echo(f"  {line:<{width}}  {what}", err=True)
