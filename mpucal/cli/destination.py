"""Where a session's calibration goes besides its files: chosen before it begins, written when it is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from ..data import Recording
from ..errors import KeepsNothing, SourceError, UsageError, WriteBackError
from ..result.calibration import REFUSED, Calibration
from ..result.session_files import DOCUMENT
from ..session.results import result_files, save
from ..sinks.sink import Applied
from .options import SOURCES
from .write import TARGETS
from .write_back import WRITTEN, ask, write_to

FILE = "file"
ON_AUTOPILOT = "calibration-on-autopilot.json"
# the source that each sink is behind
BEHIND = {"chip": ("bus", "serial"), "bridge": ("serial",), "autopilot": ("mavlink",)}
# what the sensor's user reads it from; a chip's registers forget it with the supply, and hold b_a alone
FITTING = {"serial": "bridge", "mavlink": "autopilot"}


def sink_options(command: Any) -> Any:
    """--to and --no-write."""
    for option in (
        click.option("--no-write", is_flag=True, help="Leave the files, and write nothing else."),
        click.option(
            "--to",
            "sinks",
            type=click.Choice([FILE, *BEHIND]),
            multiple=True,
            help="Where to write it, once or more often; by default a bridge's or an autopilot's memory, else files.",
        ),
    ):
        command = option(command)
    return command


def destinations(sinks: Sequence[str], no_write: bool, words: Mapping[str, Any]) -> tuple[str, ...]:
    """The sinks to write to besides the files, a chip's registers first, so that the others say what these subtract.

    Parameters
    ----------
    words : the options that name the source.

    Raises
    ------
    UsageError : a sink that is not behind the source, or sinks beside --no-write.
    """
    if no_write and sinks:
        raise UsageError("--to and --no-write were given together", "leave one of them out")
    kind = next((name for name in SOURCES if words.get(name) is not None), "")
    wrong = [name for name in sinks if name != FILE and kind not in BEHIND[name]]
    if wrong:
        has = "has no sensor to write to" if kind == "replay" else f"has no {wrong[0]}"
        where = " or ".join(f"--{name}" for name in BEHIND[wrong[0]])
        raise UsageError(f"--to {wrong[0]} was given, and --{kind} {has}", f"give {where}, or leave it out")
    if no_write:
        return ()
    chosen = sinks or ([FITTING[kind]] if kind in FITTING else [])
    return tuple(name for name in BEHIND if name in chosen)


def said(names: Sequence[str], no_write: bool) -> str:
    """Where the result will go, in a sentence for the person."""
    if no_write:
        return "The result goes to files, and nowhere else."
    where = {"chip": "the chip's offset registers", "bridge": "the bridge's memory", "autopilot": "the autopilot"}
    listed = " and ".join(["files", *(where[name] for name in names)])
    return f"The result goes to {listed}; --to and --no-write choose otherwise."


def written_back(
    names: Sequence[str],
    calibration: Calibration,
    words: Mapping[str, Any],
    yes: bool,
    folder: Path,
    record: Callable[[str, Calibration], Calibration],
    asked: Sequence[str] = (),
) -> Iterator[Applied]:
    """Write to each sink in turn, and save what is applied then; nothing of a calibration that was refused.

    Parameters
    ----------
    words : the options that name the source, with gravity and model. record : see recorder.
    asked : the sinks that --to named: a bridge whose firmware keeps nothing is no failure unless it was.

    Raises
    ------
    WriteBackError : refused or failed; what was written to the sinks before it stays. OutputError : see write_to.
    """
    for name in names if calibration.verdict != REFUSED else ():
        try:
            with TARGETS[name](words) as sink:
                ask(f"Write the calibration to {sink.where}?", yes)
                applied = write_to(sink, calibration, folder, partial(record, name))
        except SourceError as error:
            if isinstance(error, KeepsNothing) and name not in asked:
                click.echo(f"mpucal: {error.what}: the result is in files alone.", err=True)
                continue
            raise WriteBackError(f"nothing was written to the {name}: {error.what}", error.remedy) from error
        calibration = applied.calibration
        yield applied


def recorder(
    folder: Path, measured: Calibration, recording: Recording, truth: Mapping[str, Any] | None
) -> Callable[[str, Calibration], Calibration]:
    """Saves what is applied now in a session's folder.

    calibration.json stays of what was measured. A chip's registers only take a part of b_a away, which it says; behind
    new parameters an autopilot sends another stream, whose calibration is a file of its own.
    """

    def record(name: str, now: Calibration) -> Calibration:
        if name == "autopilot":
            extra = {**measured.extra, WRITTEN: now.extra[WRITTEN]}
            of_now, now = now, replace(measured, extra=MappingProxyType(extra))
            files = {ON_AUTOPILOT: of_now.json().encode(), DOCUMENT.name: now.json().encode()}
        else:
            files = (
                dict(result_files(now, recording, truth)) if name == "chip" else {DOCUMENT.name: now.json().encode()}
            )
        save(folder, files)
        return now

    return record
