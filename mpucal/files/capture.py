"""Captures decoded into samples, whole or a run at a time, without the samples that the session discarded.

A capture of a vehicle or of a driver of the kernel is always read whole. The time of a chip's first sample depends on
the last poll of its FIFO: for runs, the frames therefore wait in a temporary file, 14 bytes a sample. The polls stay in
memory, 16 bytes each or 1.4 MB an hour.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryFile
from weakref import finalize

import numpy as np

from ..chip.access import BEGUN, FORGET, OPENED, RESUMED, SAMPLED_NS, UTC, SessionEvent
from ..chip.accesses import Accesses
from ..chip.decode import Decoder, decode
from ..chip.fifo import Run
from ..data import RUN, Recording, without
from ..errors import CaptureError, RecordingError
from ..mavlink.log import read_log
from ..mavlink.tlog import RawPacket
from .mcap import CaptureReader, one_by_one
from .recorders import CHIP, VEHICLE, Recorder, recorder_of
from .rows import Rows
from .tables.times import plausible_utc_ns


def load_capture(*paths: Path) -> Recording:
    """Return the recording in the captures of one session.

    Raises
    ------
    CaptureError, RecordingError, ChipError : see load.
    """
    session = _SessionRecords(paths)
    recorder, guided = _recorder(paths)
    if recorder is VEHICLE:
        recording = read_log(session, session.name, over_reboots=guided)
    elif recorder is CHIP:
        recording = decode(session.accesses(), session.name)
    else:
        recording = decode(one_by_one(session.accesses()), session.name, resolve_name(recorder.decoder))
    recording = recording.without(session.forgotten)
    if len(recording) < 2:
        raise RecordingError(f"{session.name} holds {len(recording)} usable samples", "record for longer")
    recording = recording.interrupted_at(*sorted(session.interrupted))
    return replace(recording, recovered=session.recovered, utc_ns=session.utc_ns)


def capture_rows(*paths: Path) -> Rows:
    """Return the samples in the captures of one session, a run at a time.

    Raises
    ------
    CaptureError, RecordingError, ChipError : see load.
    """
    if _recorder(paths)[0] is not CHIP:
        return Rows.of(load_capture(*paths))
    session = _SessionRecords(paths)
    decoder, spool = Decoder(session.name), Spool()
    for access in session.accesses():
        decoder.feed(access)
        if decoder.fifo is not None:
            spool.add(decoder.fifo.release())
    if decoder.fifo is None or spool.frames < 2:
        raise RecordingError(f"{session.name} holds {spool.frames} samples", "record for longer")
    runs = decoder.fifo.final(spool.runs())
    runs = without(runs, session.forgotten) if session.forgotten else runs
    return Rows(runs, decoder.sensor, recovered=session.recovered, name=session.name, utc_ns=session.utc_ns)


class _SessionRecords:
    """Register accesses or packets in the captures of one session.

    Attributes
    ----------
    name : of the first capture. forgotten : first -> last + 1 samples that the session discarded.
    interrupted, recovered, utc_ns : see Recording. These and `forgotten` are complete when all records are read.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths
        self.name = paths[0].name
        self.forgotten: dict[int, int] = {}
        self.interrupted: set[float] = set()
        self.recovered: str | None = None
        self.utc_ns: int | None = None

    def accesses(self) -> Iterator[Accesses]:
        """Yield the accesses by the block, as they are stored."""
        return (record for record in self._records() if isinstance(record, Accesses))

    def __iter__(self) -> Iterator[RawPacket]:
        """Yield the packets that count, of which a vehicle's log is made in two passes."""
        for record in self._records():
            if isinstance(record, RawPacket) and self._counts:
                yield record

    def _records(self) -> Generator[Accesses | RawPacket]:
        self._counts = True
        for reader in map(CaptureReader, self._paths):
            for record in reader.blocks():
                if not isinstance(record, SessionEvent):
                    yield record
                    continue
                # of PAUSED, and of RESUMED but in sessions of earlier versions
                if SAMPLED_NS in record.data:
                    self.interrupted.add(self._number(record, SAMPLED_NS) * 1e-9)
                if record.name == UTC and self.utc_ns is None:
                    self.utc_ns = plausible_utc_ns(self._number(record, UTC) - record.t_ns)
                elif record.name == FORGET:
                    first, last = (self._number(record, key) for key in ("first", "last"))
                    self.forgotten[first] = last
                elif record.name in (OPENED, RESUMED, BEGUN):
                    self._counts = record.name == BEGUN
            self.recovered = reader.recovered or self.recovered

    def _number(self, event: SessionEvent, key: str) -> int:
        try:
            return int(event.data[key])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise CaptureError(
                f"{self.name} holds an event {event.name} without a whole number {key}",
                "give a capture that mpucal recorded",
            ) from error


def _recorder(paths: Sequence[Path]) -> tuple[Recorder, bool]:
    """Return what recorded captures, and whether events of a session come before the records."""
    events = False
    for reader in map(CaptureReader, paths):
        with closing(reader.blocks()) as records:
            for record in records:
                if isinstance(record, RawPacket):
                    return VEHICLE, events
                if not isinstance(record, SessionEvent):
                    return recorder_of(reader.meta, reader.name), events
                events = True
    return CHIP, events


class Spool:
    """Store of frames in a temporary file, which is deleted with it."""

    def __init__(self) -> None:
        self.frames = 0
        # the first of consecutive runs without a gap, without its frames, and their number of frames
        self._pieces: list[tuple[Run, int]] = []
        self._file = TemporaryFile()  # noqa: SIM115 - closed with the spool
        finalize(self, self._file.close)

    def add(self, runs: Sequence[Run]) -> None:
        """Append runs."""
        for run in runs:
            head, count = self._pieces[-1] if self._pieces else (run, 0)
            if not count or run.gap or (run.segment, run.first) != (head.segment, head.first + count):
                head, count = run._replace(frames=run.frames[:0]), 0
                self._pieces.append((head, count))
            self._pieces[-1] = head, count + len(run.frames)
            self._file.write(run.frames.tobytes())
            self.frames += len(run.frames)

    def runs(self) -> Iterator[Run]:
        """Yield all frames, in runs of at most RUN."""
        self._file.seek(0)
        for head, count in self._pieces:
            words = head.frames.shape[1]
            for at in range(0, count, RUN):
                data = self._file.read(2 * words * min(RUN, count - at))
                frames = np.frombuffer(data, np.int16).reshape(-1, words)
                yield Run(head.segment, head.first + at, frames, gap=head.gap and at == 0)
