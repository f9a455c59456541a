"""Clocks of a vehicle and of a bridge, which wrap and are reset: unwrapped, and followed."""

from __future__ import annotations

from enum import Enum, auto

from . import US, S
from .sample_clock import RATE_TOLERANCE

WRAP = 1 << 32
S_US = S // US
# A packet up to this late was overtaken by others; a clock further back was set back.
LATE_US = S_US
# The clock may run ahead of the times of receipt by this much more than before: packets pile up on a link.
STRAY_US = 5 * S_US


class Jump(Enum):
    """Steps of a clock: to a later time, to that of a late or repeated packet, or back to its start by a reboot."""

    NONE = auto()
    LATE = auto()
    REBOOT = auto()


class VehicleClock:
    """Unwrapped times of one message stream, which grow except for late packets.

    Parameters
    ----------
    unit_us : unit of the stream's times in us: 1 (time_usec) or 1000 (time_boot_ms).
    """

    def __init__(self, unit_us: int) -> None:
        self._unit_us = unit_us
        self._raw: int | None = None
        self._offset_us = 0
        self._latest_us = 0
        self._received_us = 0
        # The most by which the clock was ahead of the times of receipt; both have different origins.
        self._ahead_us = 0

    def unwrap(self, raw: int, received_ns: int) -> tuple[int, Jump]:
        """Return the time of `raw` in us, and the clock's jump before it.

        Parameters
        ----------
        raw : time of the message. received_ns : time of receipt by any even clock.
        """
        received_us = received_ns // US
        if self._raw is None:
            self._raw, self._latest_us, self._received_us = raw, raw * self._unit_us, received_us
            self._ahead_us = self._latest_us - received_us
            return self._latest_us, Jump.NONE
        step_us = (raw - self._raw) * self._unit_us
        wrapped_us = step_us + WRAP * self._unit_us
        passed_us = received_us - self._received_us
        if step_us < -LATE_US and abs(wrapped_us - passed_us) < STRAY_US:
            self._offset_us += WRAP * self._unit_us
            step_us = wrapped_us
        jump = Jump.NONE
        # Compared with all packets, not with the last one: after a pause, old packets are read in a burst.
        if step_us < -LATE_US or self._latest_us + step_us - received_us > self._ahead_us + STRAY_US:
            # A step ahead is that of a clock which was set.
            jump = Jump.REBOOT if step_us < 0 else Jump.NONE
            self._offset_us += max(passed_us, 1) - step_us
            step_us = max(passed_us, 1)
        t_us = raw * self._unit_us + self._offset_us
        if step_us <= 0:
            jump = Jump.LATE
        else:
            self._raw, self._latest_us, self._received_us = raw, t_us, received_us
            self._ahead_us = max(self._ahead_us, t_us - received_us)
        return t_us, jump


# No message is delayed for longer: the bridge itself lags, as an emulated one does on a busy machine.
LATE_NS = 250_000_000
# A clock that is off by more was reset; taking it for reset by mistake does no harm.
LEAP_NS = 50_000_000


class BridgeClock:
    """Bus time: the bridge's clock in ns without wraps, which continues after a reset of the bridge.

    The present time is known from the message with the shortest way to the host, which has the least `host - stamp`.
    Between two messages the clocks may drift apart by RATE_TOLERANCE, twice what a resonator
    does, which lets an estimate that fell behind come back; a bridge that lags by LATE_NS is followed.
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
            ahead_ns, drifted_ns = host_ns - t_ns, self._ahead_ns + round(RATE_TOLERANCE * (host_ns - self._seen_at_ns))
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
    """Reduce modulo WRAP to -WRAP / 2 .. WRAP / 2."""
    return (difference_us + WRAP // 2) % WRAP - WRAP // 2
