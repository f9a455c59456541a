"""Time of day for files and their names."""

from __future__ import annotations

from datetime import UTC, datetime

# A clock that shows an earlier year was never set, as on a Raspberry Pi without a network.
LEAST_YEAR = 2025


def warn_unset() -> str:
    """Return a warning if the computer's clock is not set, else empty."""
    if now().year >= LEAST_YEAR:
        return ""
    return f"The computer's clock shows {now():%Y-%m-%d}: set it, or names and dates of the results are wrong."


def now() -> datetime:
    """Return the time of day in UTC, in whole seconds."""
    return datetime.now(UTC).replace(microsecond=0)


def stamp() -> str:
    """Return the time of day as a part of a file name."""
    return now().strftime("%Y%m%d-%H%M%S")
