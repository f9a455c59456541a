"""The latest of everything that the page shows, and what of it somebody has not seen yet."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any


class Latest:
    """Values by name, each with the version in which it changed.

    Whoever is slow gets the latest values when it asks again and none that came between: nothing queues up.
    """

    def __init__(self) -> None:
        self._values: dict[str, tuple[int, Any]] = {}
        self._version = 0
        self._changed = threading.Condition()

    def update(self, values: Mapping[str, Any]) -> None:
        """Take these, and wake who waits."""
        with self._changed:
            self._version += 1
            self._values.update((name, (self._version, value)) for name, value in values.items())
            self._changed.notify_all()

    def since(self, version: int, wait_s: float) -> tuple[int, dict[str, Any]]:
        """The version now, and what changed after `version` (0: everything); nothing did where `wait_s` passed."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version, wait_s)
            return self._version, {name: value for name, (of, value) in self._values.items() if of > version}
