"""A vehicle's clock, unwrapped and followed over resets."""

from __future__ import annotations

from enum import Enum, auto

WRAP = 1 << 32
US, S_US = 1_000, 1_000_000
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
