"""Latest values of the page, and those that a client has not received yet."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any


class LatestValues:
    """Values by name, each with the version in which it changed.

    A slow client gets the latest values when it asks again, and skips those between: there is no queue.
    """

    def __init__(self) -> None:
        self._values: dict[str, tuple[int, Any]] = {}
        self._version = 0
        self._changed = threading.Condition()

    def update(self, values: Mapping[str, Any]) -> None:
        """Merge `values` and notify waiting clients."""
        with self._changed:
            self._version += 1
            self._values.update((name, (self._version, value)) for name, value in values.items())
            self._changed.notify_all()

    def since(self, version: int, wait_s: float) -> tuple[int, dict[str, Any]]:
        """Wait `wait_s` at most for changes after `version` (0: all values); return the new version and the changes."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version, wait_s)
            return self._version, {name: value for name, (of, value) in self._values.items() if of > version}
