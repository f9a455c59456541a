"""Open chip on a bus: its driver measures, and every access is recorded in an MCAP capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..chip.access import Bus
from ..chip.contents import chip_contents
from ..chip.driver import Driver
from ..chip.records import LATE
from ..errors import CaptureError
from ..files.mcap import CaptureWriter
from ..origin import Origin
from ..result.session_files import CAPTURE
from ..session.events import Prompt
from ..session.plan import Plan
from ..session.ports import Operator, ReplayedOperator, Source
from .chained_bus import ChainedBus
from .opened_source import ActiveSource, Say
from .tap import Tap
from .utc_recorder import UtcRecorder

# Key of a capture's head: the source, to resume the session.
SOURCE = "source"


@dataclass(frozen=True)
class OpenedChip:
    """Chip on a bus; see OpenedSource.

    Attributes
    ----------
    bus : open. replay : the same bus if it is a replay. words : options that open it again; see Request.words.
    """

    bus: Bus
    plan: Plan
    listeners: Sequence[Callable[[Prompt], None]] = ()
    truth: Mapping[str, Any] | None = None
    replay: ChainedBus | None = None
    recovered: str | None = None
    capture_name: str = CAPTURE.name
    words: Mapping[str, Any] = field(default_factory=dict)
    real_time: bool = True
    origin = Origin.CHIP

    def source_meta(self) -> dict[str, Any]:
        """Return the entries for the head of a capture."""
        return {SOURCE: dict(self.words)} if self.words else {}

    @property
    def resumable(self) -> bool:
        """See OpenedSource."""
        return bool(self.words)

    @property
    def where(self) -> str:
        """Description of the chip's place, for messages."""
        return f"the chip on {next(iter(self.words.values()), 'its bus')}"

    def contents(self) -> dict[str, Any]:
        """Read the registers; nothing is set up or written."""
        with closing(self.bus):
            return {"where": self.where, **chip_contents(self.bus)}

    def driver(self, bus: Any, name: str, say: Say) -> Source:
        """Make the driver that measures over `bus`."""
        return Driver(bus, self.plan.config, name, say)

    def talk(self, person: Operator) -> Operator:
        """See OpenedSource."""
        return person if self.replay is None else ReplayedOperator(person, self.replay.pending_events)

    @contextmanager
    def measuring(self, capture: Path, say: Say, recorded: str) -> Iterator[ActiveSource]:
        """See OpenedSource."""
        with closing(self.bus), CaptureWriter(capture) as writer:
            writer.start({"mpucal": __version__, "recorded": recorded, **self.plan.meta(), **self.source_meta()})
            pending = None if self.replay is None else self.replay.pending_events
            driver = self.driver(
                Tap(self.bus, UtcRecorder(writer, pending)), capture.name, lambda text: say(f"  {text}.")
            )
            if self.replay is None:
                yield ActiveSource(driver, writer.event)
            else:
                yield ActiveSource(driver, writer.event, self.replay.go_on, self._was_late)
        if self.replay is not None and self.replay.unread():
            raise CaptureError(
                f"the replay ended before the last {self.replay.unread()} accesses of its capture",
                "replay it with the mpucal that recorded it, or use `mpucal calibrate`",
            )

    def _was_late(self, _late: bool) -> bool:
        return self.replay is not None and bool(self.replay.pending_events(LATE))
