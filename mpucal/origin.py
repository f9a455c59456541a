"""Origin of samples, on which words, drawings, limits and sinks depend."""

from __future__ import annotations

import re
from enum import Enum


class Origin(Enum):
    """Kind of thing that samples come from."""

    CHIP = "a chip's registers"
    DEVICE = "a sensor with a kernel driver"
    VEHICLE = "a vehicle's autopilot, which filters and rounds them and sends them by radio or logs them"
    FILE = "a file that does not name its sensor, or what was recorded"


def name_thing(text: str, origin: Origin) -> str:
    """Return a sentence about a board; it speaks of a vehicle if samples of `origin` come from one."""
    return re.sub(r"\bboard\b", "vehicle", text) if origin is Origin.VEHICLE else text
