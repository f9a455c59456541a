"""Open source of any kind: it is measured and recorded, replayed from its capture, or resumed."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from .. import __version__
from ..chip.access import LATE, UTC, Transaction
from ..errors import CaptureError
from ..files.recorders import CHIP, DRIVER
from ..origin import Origin
from ..result.session_files import CAPTURE
from ..session.events import Prompt
from ..session.plan import Plan
from ..session.ports import Note, Operator, ReplayedOperator, Source
from .recorded_parts import RecordedParts

if TYPE_CHECKING:
    from ..files.capture_writer import CaptureWriter
    from ..files.mcap import Capture

# Key of a capture's head: the source, to resume the session.
SOURCE = "source"

Say = Callable[[str], None]
Listener = Callable[[Prompt], None]


class ActiveSource(NamedTuple):
    """Source that is being recorded; `note` records session events with it."""

    source: Source
    note: Note


class CaptureRecorder:
    """Recorder of a session; the replayed part of a resumed session is left out.

    The time of day stands before the first successful access, so that the samples can be merged with other recordings;
    a replay keeps the recorded one.
    """

    def __init__(self, writer: CaptureWriter, parts: RecordedParts[Any] | None = None) -> None:
        self._writer, self._parts, self._has_time = writer, parts, False

    @property
    def _is_new(self) -> bool:
        return self._parts is None or not (self._parts.resumes and self._parts.replaying)

    def transaction(self, transaction: Transaction) -> None:
        """Record a register access."""
        if self._parts is not None and self._parts.replaying:
            for event in self._parts.pending_events(UTC):
                self.event(UTC, event.t_ns, event.data)
        elif not self._has_time and transaction.error is None:
            self._has_time = True
            self.event(UTC, transaction.t_ns, {UTC: time.time_ns()})
        if self._is_new:
            self._writer.transaction(transaction)

    def packet(self, t_ns: int, data: bytes) -> None:
        """Record a packet of MAVLink."""
        if self._is_new:
            self._writer.packet(t_ns, data)

    def event(self, name: str, t_ns: int, data: Mapping[str, Any] | None = None) -> None:
        """Record a session event."""
        if self._is_new:
            self._writer.event(name, t_ns, data)


@dataclass
class OpenedSource(ABC):
    """Open source, with the properties of its kind.

    Attributes
    ----------
    line : open bus or transport; RecordedParts in a replay and in a resumed session. plan : of the session.
    hands : receive the prompts besides the operator. truth : returns the true parameters of a simulated sensor.
    recovered : description of a damaged capture's readable part. capture_name : name of its capture's file.
    words : options that open it again; see Request.words. A session can be resumed only with them.
    real_time : True if its time passes by itself, False if it waits for the program.
    origin : of its samples. topic : of its captures' records. version : of its driver; see files/recorders.py.
    """

    line: Any
    plan: Plan
    hands: Sequence[Listener] = ()
    truth: Callable[[], Mapping[str, Any] | None] = lambda: None
    recovered: str | None = None
    capture_name: str = CAPTURE.name
    words: Mapping[str, Any] = field(default_factory=dict)
    real_time: bool = True
    origin: ClassVar[Origin]
    topic: ClassVar[str]
    version: ClassVar[int | str] = CHIP.version

    @classmethod
    def replayed(
        cls, _capture: Capture, line: RecordedParts[Any], plan: Plan, _values: Mapping[str, Any], /, **how: Any
    ) -> OpenedSource:
        """Open the replay of such a source.

        Parameters
        ----------
        _capture : the first one. line : all that is replayed. _values : of the options. how : further attributes.
        """
        return cls(line, plan, **how)

    @property
    def parts(self) -> RecordedParts[Any] | None:
        """Recorded parts of the session, followed by the sensor itself if it is resumed; None without them."""
        return self.line if isinstance(self.line, RecordedParts) else None

    @property
    def listeners(self) -> Sequence[Listener]:
        """Receivers of the prompts besides the operator, without those that they received before."""
        return [self._only_new(hand) for hand in self.hands]

    def source_meta(self) -> dict[str, Any]:
        """Return the entries for the head of a capture."""
        return {DRIVER: self.version, **({SOURCE: dict(self.words)} if self.words else {})}

    def operator(self, person: Operator) -> Operator:
        """Return the operator who presses the keys: the given one, or the one in the capture."""
        parts = self.parts
        if parts is None:
            return person
        return ReplayedOperator(person, parts.pending_events, (lambda: not parts.replaying) if parts.resumes else None)

    @contextmanager
    def measuring(self, capture: Path, say: Say, recorded: str) -> Iterator[ActiveSource]:
        """Record the source into `capture` during a `with` block; both are closed at its end.

        Parameters
        ----------
        say : shows a sentence to the operator. recorded : time of day for the capture's head.

        Raises
        ------
        CaptureError : a replay ended before its capture did.
        """
        from ..files.capture_writer import CaptureWriter  # noqa: PLC0415 - --help records nothing

        with closing(self.line), CaptureWriter(capture) as writer:
            head = {"mpucal": __version__, "recorded": recorded, **self.plan.meta(), **self.source_meta()}
            writer.start(head, self.topic)
            with self.recorded(CaptureRecorder(writer, self.parts), capture.name, say) as active:
                yield active
        if self.parts is not None and self.parts.unread():
            raise CaptureError(
                f"the replay ended before the last {self.parts.unread()} accesses of its capture",
                "replay it with the mpucal that recorded it, or use `mpucal calibrate`",
            )

    @abstractmethod
    def recorded(self, recorder: CaptureRecorder, name: str, say: Say) -> AbstractContextManager[ActiveSource]:
        """Measure during a `with` block, and record it; `name` is that of the recording."""

    @abstractmethod
    def contents(self) -> dict[str, Any]:
        """Read the sensor's present content in JSON's types, with the key `where`; nothing is set up or written.

        Raises
        ------
        SourceError : the sensor does not answer.
        """

    def open_next_part(self) -> bool:
        """Open the next part; return False if there is none."""
        return self.parts is not None and self.parts.open_next_part()

    @property
    def replaying(self) -> bool:
        """True if its present part is a recorded one."""
        return self.parts is not None and self.parts.replaying

    def is_late(self, late: bool) -> bool:
        """Return True if an answer is late now; in a replay, if it was."""
        return bool(self.line.pending_events(LATE)) if self.replaying else late

    def _only_new(self, listener: Listener) -> Listener:
        return lambda prompt: None if self.replaying else listener(prompt)
