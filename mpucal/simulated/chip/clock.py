"""The simulated bus's time: as fast as it can be, or as slow as a person."""

from __future__ import annotations

import time
from typing import Protocol


class SimulatedClock(Protocol):
    """Time in ns since the bus was opened."""

    def now(self) -> int:
        """What the clock shows."""
        ...

    def spend(self, ns: int) -> None:
        """A transfer takes `ns`."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """Wait until it shows `t_ns`."""
        ...


class FastClock:
    """Runs only while someone waits: returns at once, the same every time."""

    def __init__(self) -> None:
        self._now = 0

    def now(self) -> int:
        """What the clock shows."""
        return self._now

    def spend(self, ns: int) -> None:
        """Go on by `ns`."""
        self._now += ns

    def sleep_until(self, t_ns: int) -> None:
        """Go on to `t_ns`."""
        self._now = max(self._now, t_ns)


class RealClock:
    """Shows the time that has passed, and sleeps."""

    def __init__(self) -> None:
        self._opened = time.monotonic_ns()
        self._busy_until = 0

    def now(self) -> int:
        """What the clock shows; while a transfer lasts, its end."""
        return max(self._busy_until, self._passed())

    def spend(self, ns: int) -> None:
        """The bus is busy for `ns`."""
        self._busy_until = self.now() + ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until it shows `t_ns`."""
        time.sleep(max(0, t_ns - self._passed()) * 1e-9)

    def _passed(self) -> int:
        return time.monotonic_ns() - self._opened


CLOCKS: dict[str, type[FastClock] | type[RealClock]] = {"fast": FastClock, "real": RealClock}
