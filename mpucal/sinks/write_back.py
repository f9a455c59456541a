"""Write of a calibration to a sink: save the old state, write, record or undo the write; and restore a saved state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..arguments import read_limited
from ..data import Recording
from ..errors import NoStorage, OutputError, RecordingError, SourceError, WriteBackError
from ..result.calibration import REFUSED, Calibration
from ..result.clock import iso_utc
from ..result.keys import FORMAT
from ..result.session_files import DOCUMENT
from ..session.results import calibration_files, result_files, save
from ..strict_json import MOST_BYTES, parse_json
from .kind import Applied, Device, Effect, Say, Sink, SinkKind
from .old_state import interrupting

# asks the user whether to go on; raises WriteBackError if not
Ask = Callable[[str], None]

NO_MEMORY = "there was not enough memory"

# key in calibration.json: the writes, one entry each
WRITTEN = "written"

# saves the calibration that applies after a write to a sink; returns the content of calibration.json
Recorder = Callable[[SinkKind, Calibration], Calibration]


def keep(kind: SinkKind, sink: Sink, folder: Path, say: Say) -> tuple[Path, ...]:
    """Save the state of the sink, and tell the user how to restore it; see Sink.keep."""
    kept = sink.keep(folder)
    for path in kept:
        say(f"the previous state is saved in {path}; `mpucal write {path} {kind.name} ...` restores it.")
    return kept


def write_to(kind: SinkKind, sink: Sink, calibration: Calibration, folder: Path, record: Recorder, say: Say) -> Applied:
    """Save the state of the sink, write, and have `record` save the result; return it as the files hold it.

    Raises
    ------
    WriteBackError : see Sink.write; or the record could not be saved, and the old state is restored.
    OutputError : the record could not be saved, and the sink keeps the new state.
    """
    kept = keep(kind, sink, folder, say)
    with _report_interruption(sink):
        applied = sink.write(calibration)
    entry = {"to": kind.name, "where": sink.where, "what": applied.what, "at": iso_utc()}
    extra = {**applied.calibration.extra, WRITTEN: [*applied.calibration.extra.get(WRITTEN, ()), entry]}
    try:
        return applied._replace(calibration=record(kind, replace(applied.calibration, extra=extra)))
    except (OutputError, MemoryError) as cause:
        error = (
            cause if isinstance(cause, OutputError) else OutputError(NO_MEMORY, "end other programs, and start again")
        )
        if kind.effect is Effect.NONE or not kept:
            raise OutputError(f"{applied.what}, but {error.what}", error.remedy) from cause
        # without a record, a bias that the device removes would be removed from its samples again
        raise WriteBackError(f"{error.what}; {sink.put_back(kept[0])}", error.remedy) from cause


def write_to_all(
    kinds: Sequence[SinkKind],
    calibration: Calibration,
    device: Device,
    folder: Path,
    record: Recorder,
    ask: Ask,
    asked: Sequence[str] = (),
    in_doubt: Ask | None = None,
) -> Iterator[Applied]:
    """Write to each sink in turn, and record each write; a refused calibration is not written.

    Parameters
    ----------
    asked : sinks named with --to: only for these is a device without memory an error.
    in_doubt : replaces `ask` if there is an objection; see write_objection.

    Raises
    ------
    WriteBackError : refused or failed; earlier sinks keep what was written. OutputError : see write_to.
    """
    for kind in kinds if calibration.verdict != REFUSED else ():
        try:
            with kind.open(device) as sink:
                objection = write_objection(calibration, sink)
                if objection is None:
                    ask(f"Write the calibration to {sink.where}?")
                else:
                    (in_doubt or ask)(f"{objection}. Write it to {sink.where} anyway?")
                applied = write_to(kind, sink, calibration, folder, record, device.say)
        except SourceError as error:
            if isinstance(error, NoStorage) and kind.name not in asked:
                device.say(f"{error.what}: the result is only in files.")
                continue
            raise WriteBackError(f"nothing was written to {kind.where}: {error.what}", error.remedy) from error
        calibration = applied.calibration
        yield applied


def write_objection(calibration: Calibration, sink: Sink) -> str | None:
    """Return the reason why only the user may decide on a write, as a clause; None if there is none.

    Raises
    ------
    SourceError : the sink cannot be read.
    """
    verification = calibration.quality.get("verification")
    reasons = [sink.reason_to_keep(calibration)]
    # a blob has no quality
    if calibration.quality and not (verification and verification.get("agrees") is True):
        reasons.insert(0, "the calibration was not verified in new orientations")
    return "; ".join(filter(None, reasons)) or None


def put_back(kind: SinkKind, sink: Sink, kept: Path, folder: Path, say: Say) -> str:
    """Restore the state saved in the file `kept`, after saving the present one; return a clause for the user.

    Raises
    ------
    WriteBackError : the sink accepts only a calibration, or see Sink.put_back.
    """
    if kind.effect is not Effect.NONE:
        keep(kind, sink, folder, say)
    with _report_interruption(sink):
        return sink.put_back(kept)


@contextmanager
def _report_interruption(sink: Sink) -> Iterator[None]:
    """Report a write that Ctrl-C, SIGTERM, SIGHUP or lack of memory ended, and that the sink has undone, as failed."""
    with interrupting():
        try:
            yield
        except (KeyboardInterrupt, MemoryError) as error:
            why = NO_MEMORY if isinstance(error, MemoryError) else "the write was interrupted"
            raise WriteBackError(f"{why}; the old state of {sink.where} is restored", "start again") from error


def session_recorder(
    folder: Path, measured: Calibration, recording: Recording, truth: Mapping[str, Any] | None
) -> Recorder:
    """Return the recorder for a session's folder, by the sink's effect; `measured` is the session's result."""

    def record(kind: SinkKind, now: Calibration) -> Calibration:
        if kind.effect is Effect.LESS_BIAS:
            save(folder, dict(result_files(now, recording, truth)))
            return now
        held = now
        files = {}
        if kind.effect is Effect.OTHER_STREAM:
            files[kind.after_write(Path(DOCUMENT.name).stem)] = now.json().encode()
            held = replace(measured, extra={**measured.extra, WRITTEN: now.extra[WRITTEN]})
        save(folder, {**files, DOCUMENT.name: held.json().encode()})
        return held

    return record


def file_recorder(path: Path) -> Recorder:
    """Return the recorder for the file `path` (.json) and a config blob (.bin) beside it."""

    def record(_kind: SinkKind, now: Calibration) -> Calibration:
        save(path.parent, calibration_files(now, path.name))
        return now

    return record


def is_calibration(path: Path) -> bool:
    """Return False if the file is a saved state of a sink; True for a calibration, even if damaged or missing."""
    if path.suffix.lower() != ".json":
        return path.suffix.lower() == ".bin" or not path.exists()
    try:
        return bool(parse_json(read_limited(path, MOST_BYTES)).get("format") == FORMAT)
    except (RecordingError, ValueError, AttributeError):
        return True
