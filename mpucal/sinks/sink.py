"""What every sink does: keep what it holds, write a calibration, and perhaps put back what it kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from ..result.calibration import Calibration


@dataclass(frozen=True)
class Applied:
    """What a write left behind.

    Attributes
    ----------
    calibration : the written one, which now says what is applied where.
    what : one sentence for the person: what was written where, and how it was checked.
    """

    calibration: Calibration
    what: str


class Sink(Protocol):
    """A place that keeps a calibration: a chip's offset registers, a bridge's EEPROM, an autopilot's parameters.

    Attributes
    ----------
    where : the very device, in words.
    """

    @property
    def where(self) -> str: ...  # noqa: D102 - see above

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save what the place holds now to files in `folder`, before anything is changed; none where it is empty.

        Raises
        ------
        SourceError : it cannot be read. OutputError : it cannot be saved.
        """
        ...

    def write(self, calibration: Calibration) -> Applied:
        """Write, read back, compare, and verify by effect where the place can show one.

        Raises
        ------
        WriteBackError : refused (nothing was written), or failed (the old state is restored); `what` says which.
        """
        ...


@runtime_checkable
class Restorable(Sink, Protocol):
    """A sink that takes back what it kept."""

    def put_back(self, kept: Path) -> str:
        """Write back what `keep` saved to `kept`, and say in one sentence what holds now.

        Raises
        ------
        RecordingError : `kept` is not what this sink keeps. WriteBackError : see Sink.
        """
        ...
