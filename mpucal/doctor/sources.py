"""The examination of each kind of source that has one, as the table of sources names it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

from ..sources.chip import OpenedChip
from .bridge import examine_bridge
from .examine import examine
from .finding import Finding


def examine_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """A chip on a bus of this computer; see examine."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds)


def examine_spi_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """A chip on an SPI bus, whose clock is as it was set; see examine."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, lambda _bus: ())


def examine_usb_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """A chip on a USB adapter, whose bus the kernel does not know; see examine."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, lambda _bus: ())


def examine_bridge_and_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """A bridge's firmware, its serial line, and the chip behind it; see examine."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, examine_bridge)
