"""Finding of the doctor: one line of its page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any, Self

from ..errors import SourceError


class Mark(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    NOTE = "note"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Attributes
    ----------
    topic : subject of the check, in a word or two. mark : severity. what : the result.
    remedy : what to do about it; empty where nothing is to be done.
    data : the numbers, in JSON's own types, units in the keys.
    """

    topic: str
    mark: Mark
    what: str
    remedy: str = ""
    data: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def check(
        cls, topic: str, passed: bool, what: str, remedy: str, data: Mapping[str, Any], mark: Mark = Mark.NOTE
    ) -> Self:
        """Return a finding that is OK if the check `passed`; else it has the `mark` and the remedy."""
        return cls(topic, Mark.OK if passed else mark, what, "" if passed else remedy, data)

    @classmethod
    def failed(cls, topic: str, error: SourceError) -> Self:
        """Return the finding of a step that ended by an error."""
        return cls(topic, Mark.BAD, error.what, error.remedy)

    def document(self) -> dict[str, Any]:
        """Return the finding in JSON's own types."""
        return {**vars(self), "data": dict(self.data)}
