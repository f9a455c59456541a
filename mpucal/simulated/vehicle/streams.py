"""Times at which a vehicle's messages are due."""

from __future__ import annotations

import math

US = 1_000_000


class StreamTimes:
    """Schedule of the streams; a stream that is late skips what it missed."""

    def __init__(self) -> None:
        self._interval_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}

    def set(self, message_id: int, interval_us: int, now_us: int) -> None:
        """Schedule a message every `interval_us` from now on; 0: never again."""
        if interval_us <= 0:
            self._interval_us.pop(message_id, None)
            return
        self._interval_us[message_id] = interval_us
        self._due_us[message_id] = now_us + interval_us

    def next_us(self) -> float:
        """Return the time of the next message, infinity if there is none."""
        return min((self._due_us[message_id] for message_id in self._interval_us), default=math.inf)

    def due(self, now_us: int, slower: int = 1) -> list[int]:
        """Return the messages due by `now_us`; `slower` stretches every interval."""
        due = [message_id for message_id in self._interval_us if self._due_us[message_id] <= now_us]
        for message_id in due:
            interval_us = self._interval_us[message_id] * slower
            self._due_us[message_id] = max(self._due_us[message_id] + interval_us, now_us - interval_us)
        return due
