"""The captures of one session in their order: the first, and one for each time it was resumed."""

from __future__ import annotations

from pathlib import Path

from ..result.session_files import CAPTURE


def captures_in(folder: Path) -> list[Path]:
    """All that are there, the first one first; none where that is missing."""
    found: list[Path] = []
    while (path := folder / CAPTURE.numbered(len(found) + 1)).exists():
        found.append(path)
    return found
