"""A session's runner with its capture, from opening to closing both. Knows no result and no kind of source."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from ..session.live.apart import Apart
from ..session.live.questions import Here
from ..session.runner import Runner
from ..sources.opened import Opened
from ..terminal.console import Console


@contextmanager
def running(source: Opened, capture: Path, person: Console) -> Iterator[Runner]:
    """A runner on `source` that records into `capture`; whatever happens, both are closed.

    Raises
    ------
    CaptureError : a replay came to its end before its capture did.
    """
    with source.measuring(capture, person.say, now().isoformat()) as measuring, person.listening():
        if source.recovered is not None:
            person.say(f"  {source.recovered}")
        yield Runner(
            measuring.source,
            source.talk(person),
            measuring.note,
            source.plan,
            source.listeners,
            measuring.go_on,
            measuring.late,
            Apart if source.real_time else Here,
        )


def now() -> datetime:
    """The time of day, to the second."""
    return datetime.now(UTC).replace(microsecond=0)


def stamp() -> str:
    """The same, for a file's name."""
    return now().strftime("%Y%m%d-%H%M%S")
