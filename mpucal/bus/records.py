"""What a capture holds, one after the other. Knows no file and no order of events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..chip.access import Transaction


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
