"""What the program asks of a kind of sink: its name, the sources it is behind, what opens it, what a write changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from ..result.session_files import DOCUMENT, SessionFile

if TYPE_CHECKING:
    from ..sources.kind import SourceKind
    from .sink import Sink

Say = Callable[[str], None]


class Effect(Enum):
    """What a write does to the samples that the sensor delivers from then on, and so what a session records of it."""

    NONE = "they stay as they were: calibration.json says that it was written"
    LESS_BIAS = "a part of b_a is gone from them: all result files are made again, and say how much"
    OTHER_STREAM = "they need another calibration, which has a file of its own; calibration.json stays as measured"


@dataclass(frozen=True)
class Flag:
    """An option of `mpucal write` for one kind of sink: its name, and what the help says."""

    name: str
    help: str


@dataclass(frozen=True)
class Device:
    """What a sink is opened on.

    Attributes
    ----------
    kind : of the source. name : as the source's option says it, such as /dev/i2c-1. open : opens the source.
    say : tells the person a sentence. flags : the names of those that were given. values : of the source's options.
    """

    kind: SourceKind
    name: str
    open: Callable[[], Any]
    say: Say
    flags: frozenset[str] = frozenset()
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SinkKind:
    """A kind of sink: one row of the table.

    Attributes
    ----------
    name : as `--to` and `mpucal write` spell it. behind : whether the devices of a kind of source have one.
    where : it, in a sentence for a person. holds : what of a calibration it holds, for the documentation.
    opener : "module:attribute" of a context manager from a Device to a Sink; imported when it is opened.
    default : whether a session on such a device writes to it where --to does not choose.
    effect : see Effect. kept : the files in which the old state may be kept. flags : see Flag.
    """

    name: str
    behind: Callable[[SourceKind], bool]
    where: str
    holds: str
    opener: str
    default: bool = False
    effect: Effect = Effect.NONE
    kept: tuple[SessionFile, ...] = ()
    flags: tuple[Flag, ...] = ()

    def open(self, device: Device) -> AbstractContextManager[Sink]:
        """The sink on `device`; closed when the context ends.

        Raises
        ------
        SourceError : the device cannot be opened; KeepsNothing, where it holds no calibration at all.
        """
        opener: Callable[[Device], AbstractContextManager[Sink]] = resolve_name(self.opener)
        return opener(device)

    def after_write(self, stem: str) -> str:
        """Name of the file with the calibration `stem` of the sensor as it is after a write."""
        return f"{stem}-on-{self.name}.json"

    @property
    def session_files(self) -> tuple[SessionFile, ...]:
        """What a write leaves in a session's folder besides what is there without one."""
        if self.effect is not Effect.OTHER_STREAM:
            return self.kept
        name = self.after_write(Path(DOCUMENT.name).stem)
        return (*self.kept, SessionFile(name, f"the calibration of the sensor as it is after a write to {self.where}"))
