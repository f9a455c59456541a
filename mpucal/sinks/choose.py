"""Which sinks a session writes to: what --to named, or what belongs to the source."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import UsageError
from ..sources.kind import Delivery, SourceKind
from ..sources.opening import one_of
from ..sources.table import SOURCES, unique
from .kind import SinkKind
from .table import SINKS

# of --to: the files of a session, which are written in any case
FILE = "file"


def chosen(asked: Sequence[str], no_write: bool, source: SourceKind) -> tuple[SinkKind, ...]:
    """The sinks to write to besides the files, in the table's order.

    Parameters
    ----------
    asked : what --to named; none: what is written to by default. source : of the session.

    Raises
    ------
    UsageError : a sink that is not behind the source, or sinks beside --no-write.
    """
    if no_write and asked:
        raise UsageError("--to and --no-write were given together", "leave one of them out")
    for name in asked:
        if name != FILE:
            check_behind(SINKS[name], source, f"--to {name} was given", ", or leave it out")
    if no_write:
        return ()
    return tuple(
        kind for kind in SINKS.values() if (kind.name in asked if asked else kind.default and kind.behind(source))
    )


def check_behind(kind: SinkKind, source: SourceKind, given: str, otherwise: str = "") -> None:
    """Refuse a sink that is not behind the source.

    Raises
    ------
    UsageError : `given`, and the source has none; give another one, `otherwise` do what that says.
    """
    if not kind.behind(source):
        has = "has no sensor to write to" if source.delivers is Delivery.CAPTURE else f"has no {kind.name}"
        raise UsageError(f"{given}, and {source.flag} {has}", f"{one_of(filter(kind.behind, SOURCES))}{otherwise}")


def announced(kinds: Sequence[SinkKind], no_write: bool) -> str:
    """Where the result will go, in a sentence for the person."""
    if no_write:
        return "Results are written to files only."
    listed = " and ".join(["files", *(kind.where for kind in kinds)])
    return f"Results are written to {listed} (change with --to or --no-write)."


def defaults() -> str:
    """Where a session writes by default, for the help."""
    listed = [f"{kind.where} of {' or '.join(behind(kind))}" for kind in SINKS.values() if kind.default]
    return f"by default {', '.join(listed)}, else files only"


def behind(kind: SinkKind) -> list[str]:
    """The options of the sources that have the sink, as a person writes them."""
    return [option.flag for option in unique(source.option for source in SOURCES if kind.behind(source))]
