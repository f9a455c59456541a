"""Findings as one page of text for a bug report, or as JSON."""

from __future__ import annotations

import json
import platform
import textwrap
from collections.abc import Sequence

from .finding import Finding, Mark

FORMAT, VERSION = "mpucal.doctor", 1
SIGNS = {Mark.OK: "  ", Mark.NOTE: "* ", Mark.BAD: "! ", Mark.UNKNOWN: "? "}
TOPIC, WIDTH = 24, 100


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
        "format": FORMAT,
        "version": VERSION,
        "mpucal": version,
        "source": source,
        "machine": f"{platform.machine()}, {platform.system()} {platform.release()}",
        "findings": [finding.document() for finding in findings],
    }
    return json.dumps(fields, indent=2, allow_nan=False)


def _wrapped(topic: str, words: str) -> list[str]:
    indent = " " * TOPIC
    return textwrap.wrap(words, WIDTH, initial_indent=topic.ljust(TOPIC), subsequent_indent=indent) or [topic]


def _many(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"
