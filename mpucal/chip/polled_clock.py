"""Times of samples that are read one by one, each when the bus's clock says: of a chip without a FIFO."""

from __future__ import annotations

from array import array

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from .clock import NS, Times

# in sample intervals, since the sample before
LATE = 2.5


class PolledClock:
    """As SampleClock, where every sample was looked at by itself and its time is that look's.

    Parameters
    ----------
    nominal_hz : the rate until two samples are there.
    """

    def __init__(self, nominal_hz: float) -> None:
        self._nominal_hz = nominal_hz
        self._t_ns = array("q")
        self._begins: list[int] = []
        self._forgotten = self._steps = self._elapsed_ns = 0

    @property
    def segment(self) -> int:
        """Which run of samples without a gap is going on."""
        return self._forgotten + len(self._begins) - 1

    def begin_segment(self) -> None:
        """Samples were lost before what follows, or it is the first."""
        self._begins.append(len(self._t_ns))

    def forget(self) -> None:
        """Let go of all segments but the one that is going on."""
        self._forgotten += len(self._begins[:-1])
        del self._t_ns[: self._begins[-1]]
        self._begins = [0]

    def add(self, t_ns: int, taken: int) -> None:
        """At `t_ns` sample number `taken` of this segment, from 1, was read."""
        if taken > 1:
            self._steps += 1
            self._elapsed_ns += t_ns - self._t_ns[-1]
        self._t_ns.append(t_ns)

    def is_late(self, t_ns: int) -> bool:
        """Whether samples were missed before one that is read at `t_ns`; the first two of a rate tell it."""
        within = len(self._t_ns) > self._begins[-1]
        return bool(within and self._steps) and t_ns - self._t_ns[-1] > LATE / self.rate_hz / NS

    def add_many(self, t_ns: NDArray[np.int64], taken: NDArray[np.int64]) -> None:
        """The same of (n,) looks."""
        for each in zip(t_ns.tolist(), taken.tolist(), strict=True):
            self.add(*each)

    @property
    def rate_hz(self) -> float:
        """Samples a second, without the gaps."""
        return self._steps / (self._elapsed_ns * NS) if self._elapsed_ns else self._nominal_hz

    def times_s(self, segment: NDArray[np.int64], index: NDArray[np.int64]) -> Vector:
        """Times (n,) of the samples number `index` (n,), from 0 in their `segment` (n,)."""
        at = np.array(self._begins)[segment - self._forgotten] + index
        return np.array([self._t_ns[i] for i in at]) * NS

    def final(self) -> Times:
        """`times_s`, which nothing makes better."""
        return self.times_s
