"""Options of the commands that write to a sink, made from the table of sinks, and the writing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..result.calibration import Calibration
from ..sinks.choose import FILE, default_sinks
from ..sinks.kind import Applied, Device, Say, SinkKind
from ..sinks.table import SINKS
from ..sinks.write_back import Recorder, write_to_all
from ..sources.opening import open_source
from ..sources.table import matching_kinds
from .common import ask, ask_in_doubt, confirm, say, say_done, together

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


def make_device(options: Mapping[str, Any], yes: bool, say: Say = say) -> Device:
    """Return the device that a command's source options name; `yes` : ask no questions."""
    kind = matching_kinds(options)[0]
    opener, answer = partial(open_source, options), partial(confirm, yes=yes)
    return Device(kind, str(options[kind.option.name]), opener, say, answer, options)


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
