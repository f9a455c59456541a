"""Present time of a device's clock, followed by the stamps of its messages and their arrival."""

from __future__ import annotations

# A ceramic resonator is within 0.5 %; twice that lets an estimate that fell behind come back.
DRIFT = 0.01
# No message is delayed for longer: the device itself lags, as an emulated one does on a busy machine.
LATE_NS = 250_000_000


class FollowedClock:
    """Clock of a device, seen from the host.

    The present time is known from the message with the shortest way to the host, which has the least `host - stamp`.
    Between two messages the clocks may drift apart by DRIFT; a device that lags by LATE_NS is followed.
    """

    def __init__(self) -> None:
        self._ahead_ns: int | None = None
        self._seen_at_ns = 0
        self._latest_ns = 0

    def now(self, host_ns: int) -> int:
        """Return the device's time, as far as it is known, at `host_ns` of the host's clock; 0 before a message."""
        return 0 if self._ahead_ns is None else host_ns - self._ahead_ns

    def follow(self, t_ns: int, host_ns: int) -> None:
        """Take the stamp `t_ns` of a message that arrived at `host_ns`."""
        ahead_ns = host_ns - t_ns
        if self._ahead_ns is not None:
            drifted_ns = self._ahead_ns + round(DRIFT * (host_ns - self._seen_at_ns))
            ahead_ns = min(ahead_ns, max(drifted_ns, ahead_ns - LATE_NS))
        self._ahead_ns, self._seen_at_ns = ahead_ns, host_ns
        self._latest_ns = max(self._latest_ns, t_ns)
