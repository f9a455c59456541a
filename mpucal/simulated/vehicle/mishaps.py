"""When what befalls a simulated vehicle befalls it. Knows not what it does."""

from __future__ import annotations

from collections.abc import Mapping

US = 1_000_000
NAMES = ("arm", "reboot", "silence", "second_station")
# how often a MAVProxy at its default asks for its stream rate
AGAIN_S = {"second_station": 15.0}


class Mishaps:
    """The faults of Options that begin at a time, each once, or again and again.

    Parameters
    ----------
    faults : name -> when [s].
    """

    def __init__(self, faults: Mapping[str, float]) -> None:
        self._due_us = {name: at_s * US for name, at_s in faults.items() if name in NAMES}

    def due(self, now_us: int) -> list[str]:
        """Those that befall it by `now_us`, since the last call."""
        due = [name for name, at_us in self._due_us.items() if at_us <= now_us]
        for name in due:
            if name in AGAIN_S:
                self._due_us[name] += AGAIN_S[name] * US
            else:
                del self._due_us[name]
        return due
