"""The host's side of a USB adapter: which are plugged in, and what --bus calls them."""

from __future__ import annotations

from collections.abc import Iterator

from ..sources.usb_i2c import adapters
from .finding import Finding, Mark


def examine_adapters(name: str) -> Iterator[Finding]:
    """A finding for each adapter that is there; `name` is the one that was asked for."""
    there = adapters()
    for spelled, what in there:
        yield Finding("USB adapter", Mark.OK, f"{what}: --bus {spelled}", "", {"bus": spelled, "what": what})
    if not there:
        yield Finding("USB adapter", Mark.NOTE, f"none is seen beside {name}", "plug it in; see docs/boards.md", {})
