"""The time of day, as files and their names say it."""

from __future__ import annotations

from datetime import UTC, datetime


def now() -> datetime:
    """The time of day, to the second, UTC."""
    return datetime.now(UTC).replace(microsecond=0)


def stamp() -> str:
    """The same, for a file's name."""
    return now().strftime("%Y%m%d-%H%M%S")
