"""Recorder that adds the time of day to a capture, so that its samples can be merged with other recordings."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ..chip.access import Transaction
from ..chip.records import UTC, Recorder, SessionEvent


class _Capture(Recorder, Protocol):
    def event(self, name: str, t_ns: int, data: Mapping[str, Any] | None = None) -> None: ...


class UtcRecorder:
    """Records the time of day before the first successful access, then every access.

    Parameters
    ----------
    capture : receives the records. pending : for a replay, which keeps its recorded time: returns the session events of
        a name since the last access.
    """

    def __init__(self, capture: _Capture, pending: Callable[[str], Sequence[SessionEvent]] | None = None) -> None:
        self._capture, self._pending, self._has_time = capture, pending, False

    def transaction(self, transaction: Transaction) -> None:
        """See Recorder."""
        if self._pending is not None:
            for event in self._pending(UTC):
                self._capture.event(UTC, event.t_ns, event.data)
        elif not self._has_time and transaction.error is None:
            self._has_time = True
            self._capture.event(UTC, transaction.t_ns, {UTC: time.time_ns()})
        self._capture.transaction(transaction)
