"""Clocks of the simulated bus: one that only waiting moves on, and one in real time."""

from __future__ import annotations

import time
from typing import Protocol


class SimulatedClock(Protocol):
    """Time in ns since the bus was opened."""

    def now(self) -> int:
        """Return the time."""
        ...

    def spend(self, ns: int) -> None:
        """Spend `ns` on a transfer."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """Wait until `t_ns`."""
        ...


class FastClock:
    """Clock that only waiting moves on: waits return at once, and each run is the same."""

    def __init__(self) -> None:
        self._now = 0

    def now(self) -> int:
        """Return the time."""
        return self._now

    def spend(self, ns: int) -> None:
        """Move on by `ns`."""
        self._now += ns

    def sleep_until(self, t_ns: int) -> None:
        """Move on to `t_ns`."""
        self._now = max(self._now, t_ns)


class RealClock:
    """Clock of the time since it was made, which sleeps."""

    def __init__(self) -> None:
        self._opened = time.monotonic_ns()
        self._busy_until = 0

    def now(self) -> int:
        """Return the time; during a transfer, that of its end."""
        return max(self._busy_until, self._passed())

    def spend(self, ns: int) -> None:
        """Keep the bus busy for `ns`."""
        self._busy_until = self.now() + ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until `t_ns`."""
        time.sleep(max(0, t_ns - self._passed()) * 1e-9)

    def _passed(self) -> int:
        return time.monotonic_ns() - self._opened


CLOCKS: dict[str, type[FastClock] | type[RealClock]] = {"fast": FastClock, "real": RealClock}
