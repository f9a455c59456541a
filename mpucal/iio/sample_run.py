"""Run of samples, from the start of the buffers or of polling to the next one: streams of counts made samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..chip.bit_flips import BitFlipFilter
from ..clocks.sample_clock import MISSING_INTERVALS, NS
from ..data import Samples, Vector, Whole
from .attributes import USUAL_BITS, SensorScale

# Columns of a row of both sensors: of each, three counts, and 1 if one of them is clipped.
ROW = 8


class StreamAligner:
    """Aligner that takes each stream's samples as they come, and returns the complete rows.

    The rows depend on the samples alone, not on how they were grouped.

    Parameters
    ----------
    widths : number of columns of each stream.
    """

    def __init__(self, widths: Sequence[int]) -> None:
        self._t = [np.zeros(0, np.int64) for _ in widths]
        self._values = [np.zeros((0, width)) for width in widths]
        self._last = [np.iinfo(np.int64).min] * len(widths)

    def add(self, stream: int, t_ns: Whole, values: Vector) -> None:
        """Add samples (n, width) of a stream at `t_ns` (n,); one that is not later than the earlier ones is dropped."""
        latest = np.maximum.accumulate(np.concatenate(([self._last[stream]], t_ns)))
        later = t_ns > latest[:-1]
        self._last[stream] = int(latest[-1])
        self._t[stream] = np.concatenate((self._t[stream], t_ns[later]))
        self._values[stream] = np.concatenate((self._values[stream], values[later]))

    def take(self) -> tuple[Whole, Vector]:
        """Return the new complete rows: times (n,) of the first stream, and all streams' columns at these times."""
        t_ns, values = self._t[0], self._values[0]
        if not all(map(len, self._t)):
            return t_ns[:0], np.zeros((0, sum(value.shape[1] for value in self._values)))
        due = int(np.searchsorted(t_ns, min(t[-1] for t in self._t), "right"))
        first = int(np.searchsorted(t_ns, max(t[0] for t in self._t)))
        asked = t_ns[first:due]
        parts = [values[first:due]]
        for i, (t, held) in enumerate(zip(self._t[1:], self._values[1:], strict=True), 1):
            parts.append(_interpolate(asked, t, held))
            if due:
                # The last sample at or before the returned times is needed for the next ones.
                kept = max(int(np.searchsorted(t, t_ns[due - 1], "right")) - 1, 0)
                self._t[i], self._values[i] = t[kept:], held[kept:]
        self._t[0], self._values[0] = t_ns[max(due, first) :], values[max(due, first) :]
        return asked, np.concatenate(parts, axis=1)


def _interpolate(asked: Whole, t: Whole, values: Vector) -> Vector:
    """Interpolate `values` (m, width) at the times `t` (m,) to the times `asked` (n,) between them."""
    if len(asked) == 0:
        return np.zeros((0, values.shape[1]))
    x, known = (asked - t[0]).astype(np.float64), (t - t[0]).astype(np.float64)
    return np.stack([np.interp(x, known, column) for column in values.T], axis=1)


@dataclass
class SampleRun:
    """Run of samples with constant settings.

    Attributes
    ----------
    accel, gyro : their scales. gyro_to_accel : (3, 3) rotation to the accelerometer's frame; None: it is the same.
    widths : number of columns of each stream, by its name: of a device, 3 counts and a mark of each of its sensors; of
        a polled channel, its count and its mark. rate_hz : of the buffers, if known.
    gap_next : True if samples are missing before the next one. offset_ns : from the buffers' clock to that of the
        accesses; None before the first frame.
    """

    accel: SensorScale
    gyro: SensorScale
    gyro_to_accel: Vector | None
    widths: Mapping[str, int]
    rate_hz: float | None
    gap_next: bool
    offset_ns: int | None = None

    def __post_init__(self) -> None:
        self._aligned = StreamAligner(list(self.widths.values()))
        self._flips = BitFlipFilter(ROW)
        self._waiting = np.zeros(0, np.int64), np.zeros((0, ROW))
        self._last_ns: int | None = None

    def add(self, stream: str, t_ns: Whole, values: Vector) -> None:
        """Add values (n, columns) of a stream at `t_ns` (n,)."""
        self._aligned.add(list(self.widths).index(stream), t_ns, values)

    def take(self, temperature_c: float) -> Samples:
        """Return the new samples, all at this temperature."""
        t_ns, values = self._aligned.take()
        if values.shape[1] > ROW:
            # Polled channels have a count and a mark each.
            counts, marks = values[:, ::2], values[:, 1::2]
            values = np.column_stack((counts[:, :3], marks[:, :3].max(1), counts[:, 3:], marks[:, 3:].max(1)))
        # Interpolated counts are rounded too, for the checks of single bits.
        values[:, 3::4] = np.ceil(values[:, 3::4])
        t_ns, counts = self._repaired(t_ns, np.round(values))
        if not len(t_ns):
            return Samples.empty()
        rates = (counts[:, 4:7] + self.gyro.offset) * self.gyro.scale
        return Samples(
            np.asarray(t_ns * NS, np.float64),
            (counts[:, :3] + self.accel.offset) * self.accel.scale,
            rates if self.gyro_to_accel is None else rates @ self.gyro_to_accel.T,
            np.full(len(t_ns), temperature_c),
            self._gaps(t_ns),
            counts[:, 3] > 0,
            counts[:, 7] > 0,
        )

    def _repaired(self, t_ns: Whole, rows: Vector) -> tuple[Whole, Vector]:
        """Return times (n,) and rows (n, ROW) without flipped bits; the last row waits while it may hold one."""
        if max(self.accel.bits or 0, self.gyro.bits or 0) > USUAL_BITS:
            return t_ns, rows
        before, waiting = self._waiting[0], self._waiting[1].astype(np.int16)
        repaired = self._flips.repair(rows.astype(np.int16), waiting)
        t_ns, rows = np.concatenate((before, t_ns)), np.concatenate((waiting, repaired)).astype(np.float64)
        ready = len(rows) - self._flips.is_open
        self._waiting = t_ns[ready:], rows[ready:]
        return t_ns[:ready], rows[:ready]

    def _gaps(self, t_ns: Whole) -> np.ndarray:
        """Return (n,) True where the buffer dropped samples; polling has no fixed interval."""
        steps = np.diff(t_ns, prepend=t_ns[0] if self._last_ns is None else self._last_ns)
        longest_ns = (
            math.inf if self.rate_hz is None or len(self.widths) > 2 else MISSING_INTERVALS * 1e9 / self.rate_hz
        )
        gaps = np.asarray(steps > longest_ns)
        gaps[0] |= self.gap_next
        self._last_ns, self.gap_next = int(t_ns[-1]), False
        return gaps
