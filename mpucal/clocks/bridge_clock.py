"""A bridge's microsecond clock, unwrapped and followed by the stamps of its messages."""

from __future__ import annotations

WRAP_US = 2**32
US = 1000

# A ceramic resonator is within 0.5 %; twice that lets an estimate that fell behind come back.
DRIFT = 0.01
# No message is delayed for longer: the bridge itself lags, as an emulated one does on a busy machine.
LATE_NS = 250_000_000
# A clock that is off by more was reset; taking it for reset by mistake does no harm.
LEAP_NS = 50_000_000


class BridgeClock:
    """Bus time: the bridge's clock in ns without wraps, which continues after a reset of the bridge.

    The present time is known from the message with the shortest way to the host, which has the least `host - stamp`.
    Between two messages the clocks may drift apart by DRIFT; a bridge that lags by LATE_NS is followed.
    """

    def __init__(self) -> None:
        self._ahead_ns: int | None = None
        self._base_ns = self._seen_at_ns = self._latest_ns = 0

    def now(self, host_ns: int) -> int:
        """Return the bus time, as far as it is known, at `host_ns` of the host's clock; 0 before a message."""
        return 0 if self._ahead_ns is None else host_ns - self._ahead_ns

    def bus_time(self, t_us: int, host_ns: int) -> int:
        """Convert `t_us` of a message, which arrived at `host_ns` of the host's clock, to bus time."""
        if self._ahead_ns is None:
            t_ns = t_us * US
            ahead_ns = host_ns - t_ns
        else:
            expected_us = (self.now(host_ns) - self._base_ns) // US
            t_ns = self._base_ns + (expected_us + _nearest(t_us - expected_us)) * US
            ahead_ns, drifted_ns = host_ns - t_ns, self._ahead_ns + round(DRIFT * (host_ns - self._seen_at_ns))
            ahead_ns = min(ahead_ns, max(drifted_ns, ahead_ns - LATE_NS))
        self._ahead_ns, self._seen_at_ns, self._latest_ns = ahead_ns, host_ns, max(self._latest_ns, t_ns)
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
