"""A session's runner with its capture, from opening to closing both. Knows no result."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path

from .. import __version__
from ..bus.tap import Tap
from ..capture.mcap import CaptureWriter
from ..chip.driver import Driver
from ..console import Console
from ..errors import CaptureError
from ..runner import Runner
from .source import Opened


@contextmanager
def running(source: Opened, capture: Path, person: Console) -> Iterator[Runner]:
    """A runner on `source` that records into `capture`; whatever happens, both are closed.

    Raises
    ------
    CaptureError : a replay came to its end before its capture did.
    """
    with closing(source.bus), CaptureWriter(capture) as writer, person.listening():
        writer.start({"mpucal": __version__, "recorded": now().isoformat(), **source.plan.meta()})
        if source.recovered is not None:
            person.say(f"  {source.recovered}")
        driver = Driver(Tap(source.bus, writer), source.plan.config, capture.name)
        talk = source.talk(person)
        yield Runner(driver, talk, writer.event, source.plan.until_end, source.listeners)
    if source.replay is not None and source.replay.unread():
        raise CaptureError(
            f"the replay ended with {source.replay.unread()} accesses of its capture unread",
            "replay it with the mpucal that recorded it, or use `mpucal calibrate`",
        )


def now() -> datetime:
    """The time of day, to the second."""
    return datetime.now(UTC).replace(microsecond=0)


def stamp() -> str:
    """The same, for a file's name."""
    return now().strftime("%Y%m%d-%H%M%S")
