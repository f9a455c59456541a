"""Time of day for files and their names, and durations as text."""

from __future__ import annotations

from datetime import UTC, datetime


def warn_unset() -> str:
    """Return a warning if the computer's clock is not set, else empty."""
    # A clock that shows an earlier year was never set, as on a Raspberry Pi without a network.
    if (now := datetime.now(UTC)).year >= 2025:
        return ""
    return f"The computer's clock shows {now:%Y-%m-%d}: set it, or names and dates of the results are wrong."


def iso_utc() -> str:
    """Return the date and time of day in UTC, as ISO 8601 writes them."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def file_stamp() -> str:
    """Return the date and time of day in UTC as a part of a file name."""
    return datetime.now(UTC).strftime("%Y%m%d-%H%M%S")


def duration(seconds: float) -> str:
    """Return a time in s, min or h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
