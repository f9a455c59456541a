"""The bridge's microsecond clock, unwrapped and seen from the host."""

from __future__ import annotations

WRAP_US = 2**32
US = 1000

# A ceramic resonator is within 0.5 %; twice that, so that an estimate can fall behind and come back.
DRIFT = 0.01
# No message is under way for longer: it is the bridge that lags, as one that is emulated on a busy machine does.
LATE_NS = 250_000_000
# A clock that is this far from what was expected of it is taken to have been reset; nothing is lost where it was not.
LEAP_NS = 50_000_000


class BridgeClock:
    """Bus time: what the bridge's clock shows, in ns without wraps; goes on where the bridge was reset.

    What the clock shows now is known from the message that took the shortest way to the host: `host - bus` is
    least for that one. Between two messages the clocks may drift apart by DRIFT; one that lags by LATE_NS is followed.
    """

    def __init__(self) -> None:
        self._base_ns = 0
        self._ahead_ns: int | None = None
        self._seen_at_ns = 0
        self._latest_ns = 0

    def seen(self, t_us: int, host_ns: int) -> int:
        """The bus time of `t_us`, which came in at `host_ns` of the host's clock."""
        if self._ahead_ns is None:
            t_ns = t_us * US
        else:
            expected_us = (self.now(host_ns) - self._base_ns) // US
            t_ns = self._base_ns + (expected_us + _nearest(t_us - expected_us)) * US
        self._follow(t_ns, host_ns)
        return t_ns

    def now(self, host_ns: int) -> int:
        """What it shows when the host's shows `host_ns`, as far as is known."""
        return host_ns - (self._ahead_ns or 0) if self._ahead_ns is not None else 0

    def greeted(self, t_us: int, host_ns: int) -> None:
        """The bridge was greeted again: where its clock leapt, it was reset, and bus time goes on from now."""
        if self._ahead_ns is not None:
            now_ns = max(self.now(host_ns), self._latest_ns)
            if abs(_nearest(t_us - (now_ns - self._base_ns) // US)) * US > LEAP_NS:
                self._base_ns = now_ns - t_us * US
        self.seen(t_us, host_ns)

    def _follow(self, t_ns: int, host_ns: int) -> None:
        ahead_ns = host_ns - t_ns
        if self._ahead_ns is not None:
            drifted_ns = self._ahead_ns + round(DRIFT * (host_ns - self._seen_at_ns))
            ahead_ns = min(ahead_ns, max(drifted_ns, ahead_ns - LATE_NS))
        self._ahead_ns, self._seen_at_ns = ahead_ns, host_ns
        self._latest_ns = max(self._latest_ns, t_ns)


def _nearest(difference_us: int) -> int:
    """The same modulo WRAP_US, -WRAP_US / 2 .. WRAP_US / 2."""
    return (difference_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
