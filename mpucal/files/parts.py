"""The captures of one session in their order: the first, and one for each time it was resumed. Knows no records."""

from __future__ import annotations

import re
from pathlib import Path

FIRST = "capture.mcap"


def capture_name(number: int) -> str:
    """Of the capture number 1, 2, ..."""
    return FIRST if number == 1 else f"capture-{number}.mcap"


def is_part(name: str) -> bool:
    """Whether a file of this name is a session's capture, which others may follow or precede."""
    return re.fullmatch(r"capture(-\d+)?\.mcap", name) is not None


def captures_in(folder: Path) -> list[Path]:
    """All that are there, the first one first; none where that is missing."""
    found: list[Path] = []
    while (path := folder / capture_name(len(found) + 1)).exists():
        found.append(path)
    return found
