"""One write of a calibration to a sink: what was there kept, what is there now recorded, or undone; and put back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from ..errors import KeepsNothing, OutputError, SourceError, WriteBackError
from ..result.calibration import REFUSED, Calibration
from ..result.clock import now
from .doubt import doubt
from .kind import Device, Say, SinkKind
from .record import WRITTEN, Record
from .signals import interrupting
from .sink import Applied, Restorable, Sink

# asks whether to go on; WriteBackError where the person says no, or where there is a doubt and no person
Ask = Callable[[str], None]

NO_MEMORY = "there was not enough memory"


def keep(kind: SinkKind, sink: Sink, folder: Path, say: Say) -> tuple[Path, ...]:
    """Save what the sink holds, and tell how to bring it back; see Sink.keep."""
    kept = sink.keep(folder)
    for path in kept:
        say(f"the previous state is saved in {path}; `mpucal write {path} {kind.name} ...` restores it.")
    return kept


def write_to(kind: SinkKind, sink: Sink, calibration: Calibration, folder: Path, record: Record, say: Say) -> Applied:
    """Keep what the sink holds, write, and have `record` save what is applied now, and give what the files then hold.

    Raises
    ------
    WriteBackError : see Sink.write; or the record could not be saved, and nothing was changed.
    OutputError : the record could not be saved, and the sink keeps what was written.
    """
    kept = keep(kind, sink, folder, say)
    with _interrupted_as_refused(sink):
        applied = sink.write(calibration)
    entry = {"to": kind.name, "where": sink.where, "what": applied.what, "at": now().isoformat()}
    extra = {**applied.calibration.extra, WRITTEN: [*applied.calibration.extra.get(WRITTEN, ()), entry]}
    try:
        return replace(applied, calibration=record(kind, replace(applied.calibration, extra=extra)))
    except (OutputError, MemoryError) as cause:
        error = (
            cause if isinstance(cause, OutputError) else OutputError(NO_MEMORY, "end other programs, and start again")
        )
        if not isinstance(sink, Restorable) or not kept:
            raise OutputError(f"{applied.what}, but {error.what}", error.remedy) from cause
        # a bias that is gone from the samples, with no file that says so, would be removed twice
        try:
            back = sink.put_back(kept[0])
        except MemoryError:
            do = f"put back what was there with `mpucal write {kept[0]} {kind.name} ...`"
            raise OutputError(f"{applied.what}, but {error.what}", do) from cause
        raise WriteBackError(f"{error.what}; {back}", error.remedy) from cause


def write_to_all(
    kinds: Sequence[SinkKind],
    calibration: Calibration,
    device: Device,
    folder: Path,
    record: Record,
    ask: Ask,
    asked: Sequence[str] = (),
    in_doubt: Ask | None = None,
) -> Iterator[Applied]:
    """Write to each sink in turn, and save what is applied then; nothing of a calibration that was refused.

    Parameters
    ----------
    asked : the sinks that --to named: a device that keeps nothing is no failure unless its sink was.
    in_doubt : asks in place of `ask` where the calibration was not verified, or what the sink holds is predicted to be
        as good.

    Raises
    ------
    WriteBackError : refused or failed; what was written to the sinks before it stays. OutputError : see write_to.
    """
    for kind in kinds if calibration.verdict != REFUSED else ():
        try:
            with kind.open(device) as sink:
                against = doubt(calibration, sink)
                if against is None:
                    ask(f"Write the calibration to {sink.where}?")
                else:
                    (in_doubt or ask)(f"{against}. Write it to {sink.where} all the same?")
                applied = write_to(kind, sink, calibration, folder, record, device.say)
        except SourceError as error:
            if isinstance(error, KeepsNothing) and kind.name not in asked:
                device.say(f"{error.what}: the result is in files only.")
                continue
            raise WriteBackError(f"nothing was written to {kind.where}: {error.what}", error.remedy) from error
        calibration = applied.calibration
        yield applied


def put_back(kind: SinkKind, sink: Sink, kept: Path, folder: Path, say: Say) -> str:
    """Write back what an earlier write kept in the file `kept`, after what is there now is kept too; say it.

    Raises
    ------
    WriteBackError : the sink takes nothing but a calibration, or see Restorable.put_back.
    """
    if not isinstance(sink, Restorable):
        raise WriteBackError(f"nothing was written: {kept} is no calibration", "give a calibration.json")
    keep(kind, sink, folder, say)
    with _interrupted_as_refused(sink):
        return sink.put_back(kept)


@contextmanager
def _interrupted_as_refused(sink: Sink) -> Iterator[None]:
    """By Ctrl-C, SIGTERM, SIGHUP or lack of memory a sink puts back what was there: a write-back that failed."""
    with interrupting():
        try:
            yield
        except (KeyboardInterrupt, MemoryError) as error:
            why = NO_MEMORY if isinstance(error, MemoryError) else "the write was interrupted"
            raise WriteBackError(f"{why}, and {sink.where} is as before", "start again") from error
