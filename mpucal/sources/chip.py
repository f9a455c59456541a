"""Open chip on a bus: its driver measures, and every access is recorded."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

from ..chip.access import Bus
from ..chip.contents import chip_contents
from ..chip.driver import Driver
from ..files.messages import BUS
from ..origin import Origin
from .opened_source import ActiveSource, CaptureRecorder, OpenedSource, Say
from .replay import Tap

if TYPE_CHECKING:
    from .reading_process import BusDriver

CAN_FORK = sys.platform == "linux"


@dataclass
class OpenedChip(OpenedSource):
    """Chip on a bus, which is its `line`; see OpenedSource.

    Attributes
    ----------
    own_process : True to read its bus in a process of its own, as one whose FIFO does not wait for this program.
    """

    _: KW_ONLY
    own_process: bool = False
    origin = Origin.CHIP
    topic = BUS

    @property
    def bus(self) -> Bus:
        """Open bus."""
        bus: Bus = self.line
        return bus

    @property
    def where(self) -> str:
        """Description of the chip's place, for messages."""
        return f"the chip on {next(iter(self.words.values()), 'its bus')}"

    def contents(self) -> dict[str, Any]:
        """Read the registers; nothing is set up or written."""
        with closing(self.bus):
            return {"where": self.where, **chip_contents(self.bus)}

    def driver(self, bus: Any, name: str, say: Say) -> BusDriver:
        """Make the driver that measures over `bus`."""
        return Driver(bus, self.plan.config, name, say)

    @contextmanager
    def recorded(self, recorder: CaptureRecorder, name: str, say: Say) -> Iterator[ActiveSource]:
        """See OpenedSource."""

        tap = Tap(self.bus, recorder.transaction)

        def tell(text: str) -> None:
            # The process that reads shows nothing.
            if tap.record == recorder.transaction:
                say(f"  {text}.")

        driver, event = self.driver(tap, name, tell), recorder.event
        if not (self.own_process and CAN_FORK):
            yield ActiveSource(driver, event)
            return
        from .reading_process import ProcessSource  # noqa: PLC0415 - only for a sensor that does not wait

        with closing(ProcessSource(driver, tap, self.parts, self.hands)) as source:
            self.hands = (source.hear,)
            yield ActiveSource(source, event)
