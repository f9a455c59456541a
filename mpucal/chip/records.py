"""What a capture holds, one after the other: register accesses and session events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from .access import Transaction

# Names of session events. KEY holds the key under its own name; LATE: an answer was late here; FORGET: samples
# first..last-1 are not to be used; RESUMED: the session was resumed here; UTC: the time of day, ns since 1970.
KEY, LATE, FORGET, RESUMED, UTC = "key", "late", "forget", "resumed", "utc"
ABORT = "abort"  # the key that ends a session


@dataclass(frozen=True)
class SessionEvent:
    """Something that reached the session beside the bus: a key press, an option, the end.

    Attributes
    ----------
    name : what happened. t_ns : the bus's clock. data : JSON's own types.
    """

    name: str
    t_ns: int
    data: Mapping[str, Any] = field(default_factory=dict)


Record = Transaction | SessionEvent


class Recorder(Protocol):
    """Keeps register accesses."""

    def transaction(self, transaction: Transaction) -> None:
        """Keep one more access."""
        ...
