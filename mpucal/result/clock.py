"""Time of day for files and their names."""

from __future__ import annotations

from datetime import UTC, datetime


def now() -> datetime:
    """Return the time of day in UTC, in whole seconds."""
    return datetime.now(UTC).replace(microsecond=0)


def stamp() -> str:
    """Return the time of day as a part of a file name."""
    return now().strftime("%Y%m%d-%H%M%S")
