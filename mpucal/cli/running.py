"""A session's runner on an open source that is recorded into a capture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..result.clock import iso_utc
from ..session.live_scheduler import InlineWorker, ProcessWorker
from ..session.runner import Runner
from ..sources.opened_source import OpenedSource
from ..terminal.console import Console


@contextmanager
def open_runner(source: OpenedSource, capture: Path, person: Console, checking: bool = False) -> Iterator[Runner]:
    """Yield a runner on `source` that records into `capture`, and close both; checking : see Runner.

    Raises
    ------
    CaptureError : a replay ended before its capture did.
    """
    with source.measuring(capture, person.say, iso_utc()) as measuring, person.listening():
        if source.recovered is not None:
            person.say(f"  {source.recovered}")
        yield Runner(
            measuring.source,
            source.operator(person),
            measuring.note,
            source.plan,
            source.listeners,
            source.open_next_part,
            source.is_late,
            ProcessWorker if source.real_time else InlineWorker,
            checking,
        )
