"""Microsecond clock of the bridge, unwrapped and seen from the host."""

from __future__ import annotations

from .followed_clock import FollowedClock

WRAP_US = 2**32
US = 1000

# A clock that is off by more was reset; taking it for reset by mistake does no harm.
LEAP_NS = 50_000_000


class BridgeClock(FollowedClock):
    """Bus time: the bridge's clock in ns without wraps, which continues after a reset of the bridge."""

    def __init__(self) -> None:
        super().__init__()
        self._base_ns = 0

    def bus_time(self, t_us: int, host_ns: int) -> int:
        """Convert `t_us` of a message, which arrived at `host_ns` of the host's clock, to bus time."""
        if self._ahead_ns is None:
            t_ns = t_us * US
        else:
            expected_us = (self.now(host_ns) - self._base_ns) // US
            t_ns = self._base_ns + (expected_us + _nearest(t_us - expected_us)) * US
        self.follow(t_ns, host_ns)
        return t_ns

    def on_greeting(self, t_us: int, host_ns: int) -> None:
        """Take the time of a reply to HELLO: if the clock leapt, the bridge was reset, and bus time continues."""
        if self._ahead_ns is not None:
            now_ns = max(self.now(host_ns), self._latest_ns)
            if abs(_nearest(t_us - (now_ns - self._base_ns) // US)) * US > LEAP_NS:
                self._base_ns = now_ns - t_us * US
        self.bus_time(t_us, host_ns)


def _nearest(difference_us: int) -> int:
    """Reduce modulo WRAP_US to -WRAP_US / 2 .. WRAP_US / 2."""
    return (difference_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
