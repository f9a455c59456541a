"""Linear interpolation of several streams at the sample times of the first one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..data import Vector

Times = NDArray[np.int64]


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

    def add(self, stream: int, t_ns: Times, values: Vector) -> None:
        """Add samples (n, width) of a stream at `t_ns` (n,); one that is not later than the earlier ones is dropped."""
        latest = np.maximum.accumulate(np.concatenate(([self._last[stream]], t_ns)))
        later = t_ns > latest[:-1]
        self._last[stream] = int(latest[-1])
        self._t[stream] = np.concatenate((self._t[stream], t_ns[later]))
        self._values[stream] = np.concatenate((self._values[stream], values[later]))

    def take(self) -> tuple[Times, Vector]:
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


def _interpolate(asked: Times, t: Times, values: Vector) -> Vector:
    """Interpolate `values` (m, width) at the times `t` (m,) to the times `asked` (n,) between them."""
    if len(asked) == 0:
        return np.zeros((0, values.shape[1]))
    x, known = (asked - t[0]).astype(np.float64), (t - t[0]).astype(np.float64)
    return np.stack([np.interp(x, known, column) for column in values.T], axis=1)
