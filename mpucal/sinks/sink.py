"""Interfaces of a sink: save its state, write a calibration, and perhaps restore the state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from ..result.calibration import Calibration


@dataclass(frozen=True)
class Applied:
    """Result of a write.

    Attributes
    ----------
    calibration : the written one, with the parts that the device applies from now on.
    what : a clause for the user: what was written where, and how it was checked.
    """

    calibration: Calibration
    what: str


class Sink(Protocol):
    """A place that keeps a calibration: a chip's offset registers, a bridge's EEPROM, an autopilot's parameters.

    Attributes
    ----------
    where : the device, for messages.
    """

    @property
    def where(self) -> str: ...  # noqa: D102 - see above

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save the state of the device to files in `folder` before anything is changed; no file if it is empty.

        Raises
        ------
        SourceError : it cannot be read. OutputError : it cannot be saved.
        """
        ...

    def write(self, calibration: Calibration) -> Applied:
        """Write, read back, compare, and verify the effect if the device can show it.

        Raises
        ------
        WriteBackError : refused (nothing was written), or failed (the old state is restored); `what` says which.
        """
        ...


@runtime_checkable
class Restorable(Sink, Protocol):
    """Sink that can restore a saved state."""

    def put_back(self, kept: Path) -> str:
        """Restore the state that `keep` saved to `kept`; return a clause on it for the user.

        Raises
        ------
        RecordingError : `kept` is not a state of this sink. WriteBackError : see Sink.
        """
        ...


@runtime_checkable
class ComparableSink(Sink, Protocol):
    """Sink that can predict whether a calibration is better than the one that it holds."""

    def reason_to_keep(self, calibration: Calibration) -> str | None:
        """Return why the held calibration is predicted to be as good, as a clause; None if the new one is better.

        Raises
        ------
        SourceError : it cannot be read.
        """
        ...
