"""Captures, a run of samples at a time. Knows no other kind of file.

When a capture's first sample was taken is known only with its last look: what the FIFO held goes to a temporary file
meanwhile, 14 bytes a sample. Of the looks 16 bytes each stay in memory: 1.4 MB an hour.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryFile
from weakref import finalize

import numpy as np

from ...chip.decode import Decoder
from ...chip.fifo import Run
from ...chip.records import FORGET, SessionEvent
from ...data import Samples
from ...errors import RecordingError
from ..mcap import CaptureReader
from . import ROWS, Rows


def capture_rows(paths: Sequence[Path]) -> Rows:
    """The samples in the captures of one session, without what its person wanted to forget.

    Raises
    ------
    CaptureError, RecordingError, ChipError : see load.
    """
    name = paths[0].name
    decoder, spool = Decoder(name), Spool()
    forgotten: dict[int, int] = {}
    recovered: str | None = None
    for reader in map(CaptureReader, paths):
        for record in reader:
            if not isinstance(record, SessionEvent):
                decoder.saw(record)
                spool.add(decoder.release())
            elif record.name == FORGET:
                forgotten[int(record.data["first"])] = int(record.data["last"])
        recovered = reader.recovered or recovered
    if spool.frames < 2:
        raise RecordingError(f"{name} holds {spool.frames} samples", "record for longer")
    return Rows(_without(decoder.final(spool.runs()), forgotten), decoder.sensor, recovered=recovered, name=name)


@dataclass
class _Piece:
    """Runs that follow each other without a gap, of so many frames."""

    head: Run
    frames: int


class Spool:
    """Frames in a file that is gone with it."""

    def __init__(self) -> None:
        self.frames = 0
        self._pieces: list[_Piece] = []
        self._file = TemporaryFile()  # noqa: SIM115 - closed with the spool
        finalize(self, self._file.close)

    def add(self, runs: Sequence[Run]) -> None:
        """Keep runs, after those that are there."""
        for run in runs:
            self._file.write(run.frames.tobytes())
            self.frames += len(run.frames)
            if not self._continues(run):
                self._pieces.append(_Piece(replace(run, frames=run.frames[:0]), 0))
            self._pieces[-1].frames += len(run.frames)

    def runs(self) -> Iterator[Run]:
        """All that was added, in runs of at most ROWS frames."""
        self._file.seek(0)
        for piece in self._pieces:
            words, first = piece.head.frames.shape[1], piece.head.first
            for at in range(0, piece.frames, ROWS):
                count = min(ROWS, piece.frames - at)
                frames = np.frombuffer(self._file.read(2 * words * count), np.int16).reshape(count, words)
                yield Run(piece.head.segment, first + at, frames, gap=piece.head.gap and at == 0)

    def _continues(self, run: Run) -> bool:
        if not self._pieces or run.gap:
            return False
        last = self._pieces[-1]
        return (last.head.segment, last.head.first + last.frames) == (run.segment, run.first)


def _without(runs: Iterator[Samples], forgotten: Mapping[int, int]) -> Iterator[Samples]:
    """All samples but `first..last-1`, and a gap where they were."""
    at, cut = 0, False
    for samples in runs:
        number = np.arange(at, at + len(samples))
        kept = np.ones(len(samples), bool)
        for first, last in forgotten.items():
            kept &= (number < first) | (number >= last)
        gap = samples.gap | (kept & ~np.concatenate(([not cut], kept[:-1])))
        at, cut = at + len(samples), not kept[-1]
        columns = {name: getattr(samples, name)[kept] for name in Samples.__dataclass_fields__}
        if kept.any():
            yield Samples(**columns | {"gap": gap[kept]})
