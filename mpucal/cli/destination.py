"""Options of the commands that write to a sink, made from the table of sinks, and the writing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..errors import UsageError
from ..result.calibration import Calibration
from ..sinks.choose import FILE, check_behind, default_sinks
from ..sinks.kind import Applied, Device, Say, SinkKind
from ..sinks.table import SINKS
from ..sinks.write_back import Recorder, write_to_all
from ..sources.kind import SourceKind
from ..sources.opening import open_source
from ..sources.table import matching_kinds
from .arguments import together
from .person import ask, ask_in_doubt, confirm, say, say_done

session_sink_options = together(
    click.option(
        "--to",
        "sinks",
        type=click.Choice([FILE, *SINKS]),
        multiple=True,
        help=f"Where to write the result, may be repeated; {default_sinks()}.",
    ),
    click.option("--no-write", is_flag=True, help="Write only files."),
)
# the options that belong to one kind of sink, such as --store
sink_flags = together(
    *(
        click.option(f"--{flag.name}", is_flag=True, help=f"{kind.name}: {flag.help}")
        for kind in SINKS.values()
        for flag in kind.flags
    )
)


def make_device(options: Mapping[str, Any], yes: bool, say: Say = say) -> Device:
    """Return the device that a command's source options name, with the flags of sinks; `yes` : ask no questions."""
    kind = matching_kinds(options)[0]
    flags = {flag.name for kind in SINKS.values() for flag in kind.flags}
    given = frozenset(name for name in flags if options.get(name))
    opener, answer = partial(open_source, options), partial(confirm, yes=yes)
    return Device(kind, str(options[kind.option.name]), opener, say, given, answer, options)


def check_sink(kind: SinkKind, source: SourceKind, options: Mapping[str, Any]) -> None:
    """Raise UsageError if the sink is not behind the source, or a flag belongs to another sink."""
    check_behind(kind, source, f"{kind.name} was named")
    for other in SINKS.values():
        for flag in other.flags:
            if options.get(flag.name) and flag not in kind.flags:
                raise UsageError(f"--{flag.name} was given, and {kind.where} does not take it", "leave it out")


def write_back(
    kinds: Sequence[SinkKind],
    calibration: Calibration,
    options: Mapping[str, Any],
    folder: Path,
    record: Recorder,
    sinks: tuple[str, ...],
    yes: bool,
    as_json: bool,
    say: Say = say,
) -> Iterator[Applied]:
    """Write a calibration to each of `kinds`, and print what was done; see write_to_all.

    Parameters
    ----------
    sinks : those that the person named with --to. yes : ask no questions. say : shows the person a sentence.
    """
    agree, in_doubt = partial(ask, yes=yes), partial(ask_in_doubt, yes=yes)
    device = make_device(options, yes, say)
    for applied in write_to_all(kinds, calibration, device, folder, record, agree, sinks, in_doubt):
        say_done(applied.clauses, as_json)
        yield applied
