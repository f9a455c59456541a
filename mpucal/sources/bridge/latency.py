"""How late replies come over a line: radio, networks and busy hosts hold them back, and no bridge is gone for that."""

from __future__ import annotations

# RFC 6298, 2.3: the smoothed time, its mean deviation, and how many of these a reply may be late
GAIN, DEVIATION_GAIN, DEVIATIONS = 1 / 8, 1 / 4, 4
# a line that is worse holds no session
LONGEST_NS = 3_000_000_000


class Latency:
    """The times that requests and their replies took together, smoothed."""

    def __init__(self) -> None:
        self._mean_ns: float | None = None
        self._deviation_ns = 0.0

    def took(self, ns: int) -> None:
        """A reply to what was sent once came after `ns`."""
        if self._mean_ns is None:
            self._mean_ns, self._deviation_ns = ns, ns / 2
            return
        self._deviation_ns += DEVIATION_GAIN * (abs(ns - self._mean_ns) - self._deviation_ns)
        self._mean_ns += GAIN * (ns - self._mean_ns)

    @property
    def most_ns(self) -> int:
        """How long a reply takes at most, as far as is known; 0 before the first."""
        return min(LONGEST_NS, round((self._mean_ns or 0.0) + DEVIATIONS * self._deviation_ns))
