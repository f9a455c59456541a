"""Latency of a line: radio, networks and busy hosts delay replies without the bridge being lost."""

from __future__ import annotations

# RFC 6298, 2.3: gains of the smoothed time and its mean deviation, and the number of deviations in a time-out.
GAIN, DEVIATION_GAIN, DEVIATIONS = 1 / 8, 1 / 4, 4
# A line with a larger latency cannot carry a session.
LONGEST_NS = 3_000_000_000


class Latency:
    """Smoothed round-trip time of requests and their replies."""

    def __init__(self) -> None:
        self._mean_ns: float | None = None
        self._deviation_ns = 0.0

    def add(self, ns: int) -> None:
        """Add the round-trip time of a request that was sent once."""
        if self._mean_ns is None:
            self._mean_ns, self._deviation_ns = ns, ns / 2
            return
        self._deviation_ns += DEVIATION_GAIN * (abs(ns - self._mean_ns) - self._deviation_ns)
        self._mean_ns += GAIN * (ns - self._mean_ns)

    @property
    def most_ns(self) -> int:
        """Longest round-trip time to expect; 0 before the first reply."""
        return min(LONGEST_NS, round((self._mean_ns or 0.0) + DEVIATIONS * self._deviation_ns))
