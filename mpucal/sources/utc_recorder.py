"""Recorder that adds the time of day to a capture, so that its samples can be merged with other recordings."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Protocol

from ..chip.access import Transaction
from ..chip.records import UTC, Recorder
from .chain import Chain


class _Capture(Recorder, Protocol):
    def event(self, name: str, t_ns: int, data: Mapping[str, Any] | None = None) -> None: ...


class UtcRecorder:
    """Records the time of day before the first successful access, then every access.

    Parameters
    ----------
    capture : receives the records. parts : recorded ones, which keep their recorded time.
    """

    def __init__(self, capture: _Capture, parts: Chain[Any] | None = None) -> None:
        self._capture, self._parts, self._has_time = capture, parts, False

    def transaction(self, transaction: Transaction) -> None:
        """See Recorder."""
        if self._parts is not None and self._parts.replaying:
            for event in self._parts.pending_events(UTC):
                self._capture.event(UTC, event.t_ns, event.data)
        elif not self._has_time and transaction.error is None:
            self._has_time = True
            self._capture.event(UTC, transaction.t_ns, {UTC: time.time_ns()})
        self._capture.transaction(transaction)
