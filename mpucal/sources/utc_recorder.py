"""The time of day in a capture, so that its samples can be merged with what others recorded meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ..chip.access import Transaction
from ..chip.records import UTC, Recorder, SessionEvent


class _Capture(Recorder, Protocol):
    def event(self, name: str, t_ns: int, data: Mapping[str, Any] | None = None) -> None: ...


class UtcRecorder:
    """Keeps the time of day before the first access that succeeded, then every access.

    Parameters
    ----------
    capture : where to. pending : of a replay, the session events of a name since the last access: it keeps its date.
    """

    def __init__(self, capture: _Capture, pending: Callable[[str], Sequence[SessionEvent]] | None = None) -> None:
        self._capture, self._pending, self._is_dated = capture, pending, False

    def transaction(self, transaction: Transaction) -> None:
        """See Recorder."""
        if self._pending is not None:
            for event in self._pending(UTC):
                self._capture.event(UTC, event.t_ns, event.data)
        elif not self._is_dated and transaction.error is None:
            self._is_dated = True
            self._capture.event(UTC, transaction.t_ns, {UTC: time.time_ns()})
        self._capture.transaction(transaction)
