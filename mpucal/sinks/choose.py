"""Sinks of a source: those that a session writes to, by --to or by default, and those with an interrupted write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..errors import UsageError
from ..origin import Origin
from ..result.journal import AT, Journal
from ..sources.kind import SourceKind
from ..sources.opening import one_of
from ..sources.table import SOURCES, unique
from .kind import SinkKind
from .table import SINKS

# value of --to for the session's files, which are always written
FILE = "file"


def choose_sinks(asked: Sequence[str], no_write: bool, source: SourceKind) -> tuple[SinkKind, ...]:
    """Return the sinks to write to besides files, in the table's order.

    Parameters
    ----------
    asked : names given with --to; empty: the defaults. source : of the session.

    Raises
    ------
    UsageError : the source does not have such a sink, or --to is given with --no-write.
    """
    if no_write and asked:
        raise UsageError("--to and --no-write exclude each other", "leave one of them out", without="--no-write")
    for name in asked:
        if name != FILE:
            check_has_sink(SINKS[name], source, f"--to {name} was given", f"--to {name}")
    if no_write:
        return ()
    return tuple(
        kind for kind in SINKS.values() if (kind.name in asked if asked else kind.default and kind.fits(source))
    )


def check_has_sink(kind: SinkKind, source: SourceKind, given: str, without: str = "") -> None:
    """Check that the source has such a sink.

    Parameters
    ----------
    given : the beginning of the message. without : the option that may be left out.

    Raises
    ------
    UsageError : it does not.
    """
    if not kind.fits(source):
        has = "has no sensor to write to" if source.origin is Origin.FILE else f"has no {kind.name}"
        remedy = one_of(filter(kind.fits, SOURCES)) + (", or leave it out" if without else "")
        raise UsageError(f"{given}, but {source.flag} {has}", remedy, without=without)


def announce_sinks(kinds: Sequence[SinkKind], no_write: bool) -> str:
    """Return a sentence for the user on where the result will be written."""
    if no_write:
        return "Results are written to files only."
    listed = " and ".join(["files", *(kind.where for kind in kinds)])
    return f"Results are written to {listed} (change with --to or --no-write)."


def default_sinks() -> str:
    """Return the default sinks as text for the help."""
    listed = [f"{kind.where} of {' or '.join(source_flags(kind))}" for kind in SINKS.values() if kind.default]
    return f"by default {', '.join(listed)}, else files only"


def source_flags(kind: SinkKind) -> list[str]:
    """Return the command-line options of the sources that have the sink."""
    return [option.flag for option in unique(source.option for source in SOURCES if kind.fits(source))]


def interrupted_writes(kind: SourceKind, options: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each sink of a source where a write was interrupted, as by a power cut."""
    for sink in SINKS.values():
        left = Journal.of(sink.name, options[kind.option.name]).interrupted() if sink.fits(kind) else None
        if left is not None:
            yield (
                f"a write to {sink.where} was cut off at {left[AT]}: it may hold old and new values;"
                f" the next `mpucal write CALIBRATION {sink.name} {kind.option.flag} ...` first restores the old"
            )
