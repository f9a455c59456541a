"""Writes to a sink that were cut off, as by a loss of power, and that nothing has restored yet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..result.journal import AT, Journal
from ..sources.kind import SourceKind
from .table import SINKS


def interrupted_writes(kind: SourceKind, options: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each sink of a source where a write was interrupted, as by a power cut."""
    for sink in SINKS.values():
        left = Journal.of(sink.name, options[kind.option.name]).interrupted() if sink.behind(kind) else None
        if left is not None:
            yield (
                f"a write to {sink.where} was cut off at {left[AT]}: it may hold old and new values;"
                f" the next `mpucal write CALIBRATION {sink.name} {kind.option.flag} ...` first restores the old"
            )
