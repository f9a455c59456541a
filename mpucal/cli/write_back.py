"""One write of a calibration into a place: what was there kept, what is there recorded, or undone. Knows no option."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import click

from ..errors import OutputError, WriteBackError
from ..result.calibration import Calibration
from ..sinks.sink import Applied, Restorable, Sink
from .running import now

WRITTEN = "written"


def ask(question: str, yes: bool) -> None:
    """Go on where the person agrees, or cannot be asked.

    Raises
    ------
    WriteBackError : the person said no.
    """
    if not yes and sys.stdin.isatty() and not click.confirm(question, err=True):
        raise WriteBackError("nothing was written: you said no", "repeat it when you want it written")


def keep(sink: Sink, folder: Path) -> tuple[Path, ...]:
    """Save what the place holds, and tell how to bring it back; see Sink.keep."""
    kept = sink.keep(folder)
    for path in kept:
        again = f"mpucal write {path} {sink.name} ..."
        click.echo(f"mpucal: what it held is kept in {path}: `{again}` brings it back.", err=True)
    return kept


Record = Callable[[Calibration], Calibration]


def write_to(sink: Sink, calibration: Calibration, folder: Path, record: Record) -> Applied:
    """Keep what the place holds, write, and have `record` save what is applied now, and give what the files then hold.

    Raises
    ------
    WriteBackError : see Sink.write; or the record could not be saved, and the place holds what it held.
    OutputError : the record could not be saved, and the place keeps what was written.
    """
    kept = keep(sink, folder)
    applied = sink.write(calibration)
    entry = {"to": sink.name, "where": sink.where, "what": applied.what, "at": now().isoformat()}
    extra = {**applied.calibration.extra, WRITTEN: [*applied.calibration.extra.get(WRITTEN, ()), entry]}
    try:
        return replace(applied, calibration=record(replace(applied.calibration, extra=MappingProxyType(extra))))
    except OutputError as error:
        if not isinstance(sink, Restorable) or not kept:
            raise OutputError(f"{applied.what}, but {error.what}", error.remedy) from error
        # a bias that is gone from the samples, with no file that says so, would be removed twice
        raise WriteBackError(f"{error.what}; {sink.put_back(kept[0])}", error.remedy) from error
