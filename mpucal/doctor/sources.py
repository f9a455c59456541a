"""Examinations by kind of source, as the table of sources names them; see examine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

from ..sources.chip import OpenedChip
from .bridge import examine_bridge
from .examine import examine
from .finding import Finding


def examine_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a chip and its I2C bus."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds)


def examine_chip_alone(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a chip on an SPI bus or a USB adapter, where times of replies do not show the bus's speed."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, lambda _bus: ())


def examine_bridge_and_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a bridge's firmware, its serial line, and the chip behind it."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, examine_bridge)
