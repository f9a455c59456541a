"""Findings of the doctor, and their page: text for a bug report, or JSON."""

from __future__ import annotations

import json
import platform
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Self

from ..errors import SourceError


class Mark(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    NOTE = "note"
    BAD = "bad"
    UNKNOWN = "unknown"


SIGNS = {Mark.OK: "  ", Mark.NOTE: "* ", Mark.BAD: "! ", Mark.UNKNOWN: "? "}


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
    data: Mapping[str, Any] = field(default_factory=dict)

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


def text(source: str, version: str, findings: Sequence[Finding]) -> str:
    """Return the page; findings that need attention begin with !, * or ?."""
    head = f"mpucal {version} doctor on {source} ({platform.machine()}, {platform.system()} {platform.release()})"
    lines = [head, ""]
    for finding in findings:
        lines += _wrapped(SIGNS[finding.mark] + finding.topic, finding.what)
        if finding.remedy:
            lines += _wrapped("", f"-> {finding.remedy}")
    worst = sum(finding.mark is Mark.BAD for finding in findings)
    notes = sum(finding.mark in (Mark.NOTE, Mark.UNKNOWN) for finding in findings)
    lines += ["", f"{_many(worst, 'fault')} (!), {_many(notes, 'note')} (* or ?)."]
    return "\n".join(lines)


def document(source: str, version: str, findings: Sequence[Finding]) -> str:
    """Return the findings as JSON."""
    fields = {
        "format": "mpucal.doctor",
        "version": 1,
        "mpucal": version,
        "source": source,
        "machine": f"{platform.machine()}, {platform.system()} {platform.release()}",
        "findings": [finding.document() for finding in findings],
    }
    return json.dumps(fields, indent=2, allow_nan=False)


def _wrapped(topic: str, words: str) -> list[str]:
    return textwrap.wrap(words, 100, initial_indent=f"{topic:<24}", subsequent_indent=f"{'':<24}") or [topic]


def _many(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"
