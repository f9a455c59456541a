"""Kinds of sinks, and the interface of a sink: save its state, write a calibration, and perhaps restore the state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import WriteBackError
from ..result.session_files import DOCUMENT, SessionFile

if TYPE_CHECKING:
    from ..result.calibration import Calibration
    from ..sources.kind import SourceKind

Say = Callable[[str], None]
# asks the user a question, and returns the answer; True or False as the second argument says with --yes
Confirm = Callable[[str, bool], bool]


def decline(_question: str, _with_yes: bool) -> bool:
    """Answer no, where there is no user to ask."""
    return False


class Effect(Enum):
    """Effect of a write on later samples of the sensor, which decides how a session records the write."""

    NONE = "they stay the same: calibration.json lists the write"
    LESS_BIAS = "a part of b_a is removed from them: all result files are made again with that part"
    OTHER_STREAM = "they need another calibration, in a file of its own; calibration.json stays as measured"


@dataclass(frozen=True)
class Device:
    """Device of a sink.

    Attributes
    ----------
    kind : of the source. name : value of the source's option, such as /dev/i2c-1. open : opens the source.
    say : shows the user a sentence. confirm : asks the user. values : of the source's options.
    """

    kind: SourceKind
    name: str
    open: Callable[[], Any]
    say: Say
    confirm: Confirm = decline
    values: Mapping[str, Any] = field(default_factory=dict)


class SinkKind(NamedTuple):
    """Kind of sink: one row of the table.

    Attributes
    ----------
    name : for `--to` and `mpucal write`. fits : returns True if devices of a kind of source have such a sink.
    where : its name in messages. holds : the part of a calibration that it holds, for the documentation.
    opener : "module:function" of a context manager from a Device to a Sink; imported when it is opened.
    default : a session on such a device writes to it without --to.
    effect : see Effect. kept : files in which the old state may be saved.
    """

    name: str
    fits: Callable[[SourceKind], bool]
    where: str
    holds: str
    opener: str
    default: bool = False
    effect: Effect = Effect.NONE
    kept: tuple[SessionFile, ...] = ()

    def open(self, device: Device) -> AbstractContextManager[Sink]:
        """Open the sink on `device`; it is closed when the context ends.

        Raises
        ------
        SourceError : the device cannot be opened; NoStorage if it has no memory for a calibration.
        """
        opener: Callable[[Device], AbstractContextManager[Sink]] = resolve_name(self.opener)
        return opener(device)

    def after_write(self, stem: str) -> str:
        """Return the name of the file with the calibration `stem` as it applies after a write."""
        return f"{stem}-on-{self.name}.json"

    @property
    def session_files(self) -> tuple[SessionFile, ...]:
        """Return the extra files that a write adds to a session's folder."""
        if self.effect is not Effect.OTHER_STREAM:
            return self.kept
        name = self.after_write(Path(DOCUMENT.name).stem)
        return (*self.kept, SessionFile(name, f"the calibration that applies after a write to {self.where}"))


class Applied(NamedTuple):
    """Result of a write.

    Attributes
    ----------
    calibration : the written one, with the parts that the device applies from now on.
    clauses : for the user: what was written where, and how it was checked.
    """

    calibration: Calibration
    clauses: tuple[str, ...]

    @property
    def what(self) -> str:
        """Sentence of all clauses."""
        return "; ".join(self.clauses)


class Sink(ABC):
    """A place that keeps a calibration: a chip's offset registers, a bridge's EEPROM, an autopilot's parameters.

    Attributes
    ----------
    where : the device, for messages.
    """

    where: str

    def keep(self, _folder: Path) -> tuple[Path, ...]:
        """Save the state of the device to files in a folder before anything is changed; no file if it is empty.

        Raises
        ------
        SourceError : it cannot be read. OutputError : it cannot be saved.
        """
        return ()

    @abstractmethod
    def write(self, calibration: Calibration) -> Applied:
        """Write, read back, compare, and verify the effect if the device can show it.

        Raises
        ------
        WriteBackError : refused (nothing was written), or failed (the old state is restored); `what` says which.
        """

    def put_back(self, kept: Path) -> str:
        """Restore the state that `keep` saved to `kept`; return a clause on it for the user.

        Every sink with another Effect than NONE can do so.

        Raises
        ------
        RecordingError : `kept` is not a state of this sink. WriteBackError : see `write`.
        """
        raise WriteBackError(f"nothing was written: {kept} is not a calibration", "give a calibration.json")

    def reason_to_keep(self, _calibration: Calibration) -> str | None:
        """Return why the held calibration is predicted to be as good, as a clause; None if the new one is better.

        Raises
        ------
        SourceError : it cannot be read.
        """
        return None
