"""One thing that was found out, and what it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from ..errors import SourceError


class Mark(StrEnum):
    """How to take a finding."""

    OK = "ok"
    NOTE = "note"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Finding:
    """One line of the page.

    Attributes
    ----------
    topic : what was looked at, in a word or two. mark : how to take it. what : what was found.
    remedy : what to do about it; empty where nothing is to be done.
    data : the numbers, in JSON's own types, units in the keys.
    """

    topic: str
    mark: Mark
    what: str
    remedy: str = ""
    data: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "topic": self.topic,
            "mark": self.mark.value,
            "what": self.what,
            "remedy": self.remedy,
            "data": dict(self.data),
        }


def failed(topic: str, error: SourceError) -> Finding:
    """A step that an error ended."""
    return Finding(topic, Mark.BAD, error.what, error.remedy)
