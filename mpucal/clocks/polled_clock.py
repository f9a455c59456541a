"""Clock of a chip without a FIFO: each sample is read by itself, at a time of the bus's clock."""

from __future__ import annotations

from array import array

import numpy as np

from ..data import GAP_INTERVALS, Vector
from .sample_clock import NS, Times, Whole


class PolledClock:
    """Times of samples as SampleClock has them, each the time of its own read.

    Parameters
    ----------
    nominal_hz : rate until there are two samples.
    """

    def __init__(self, nominal_hz: float) -> None:
        self._nominal_hz = nominal_hz
        self._t_ns = array("q")
        self._begins: list[int] = []
        self._forgotten = self._steps = self._elapsed_ns = 0

    @property
    def segment(self) -> int:
        """Number of the current segment: a run of samples without a gap."""
        return self._forgotten + len(self._begins) - 1

    def begin_segment(self) -> None:
        """Begin a segment: at the start, and after samples were lost."""
        self._begins.append(len(self._t_ns))

    def forget(self) -> None:
        """Forget all segments except the current one."""
        self._forgotten += len(self._begins[:-1])
        del self._t_ns[: self._begins[-1]]
        self._begins = [0]

    def add(self, t_ns: Whole, taken: Whole) -> None:
        """Add the times (n,) of the reads of samples number `taken` (n,), from 1, of the current segment."""
        for t, number in zip(t_ns.tolist(), taken.tolist(), strict=True):
            if number > 1:
                self._steps += 1
                self._elapsed_ns += t - self._t_ns[-1]
            self._t_ns.append(t)

    def is_late(self, t_ns: int) -> bool:
        """Return True if samples were missed before one that is read at `t_ns`; two samples are needed for the rate."""
        within = len(self._t_ns) > self._begins[-1]
        return bool(within and self._steps) and t_ns - self._t_ns[-1] > GAP_INTERVALS / self.rate_hz / NS

    @property
    def rate_hz(self) -> float:
        """Samples a second, without the gaps."""
        return self._steps / (self._elapsed_ns * NS) if self._elapsed_ns else self._nominal_hz

    def times_s(self, segment: Whole, index: Whole) -> Vector:
        """Return the times (n,) of samples `index` (n,), from 0 in their `segment` (n,)."""
        at = np.array(self._begins)[segment - self._forgotten] + index
        return np.array([self._t_ns[i] for i in at]) * NS

    def final(self) -> Times:
        """Return `times_s`: later reads do not improve the times."""
        return self.times_s
