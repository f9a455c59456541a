"""Session that is resumed after an interruption: its captures are replayed, then the sensor is measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import __version__
from ..chip.records import KEY, LATE
from ..errors import UsageError
from ..files.folder import captures_in
from ..files.mcap import CaptureWriter, read_capture
from ..origin import Origin
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE
from ..session.events import Key, Output, Prompt
from ..session.plan import Plan
from ..session.ports import Operator
from .chained_bus import ChainedBus, ShiftedClockBus, split_at_resumes
from .chip import SOURCE, OpenedChip
from .opened_source import ActiveSource, Say
from .opening import reopen_source
from .replay import ReplayBus
from .tap import Tap
from .utc_recorder import UtcRecorder


@dataclass(frozen=True)
class ResumedChip:
    """Recorded parts of a session and the sensor to continue with; see OpenedSource.

    Attributes
    ----------
    bus : the recorded parts, then the sensor, whose accesses alone are recorded. live : the open sensor.
    """

    bus: ChainedBus
    live: OpenedChip
    plan: Plan
    recovered: str | None
    capture_name: str
    truth: Mapping[str, Any] | None
    real_time: bool
    resumable: bool = True

    @property
    def origin(self) -> Origin:
        """See OpenedSource."""
        return self.live.origin

    @property
    def listeners(self) -> Sequence[Callable[[Prompt], None]]:
        """Listeners that do not receive the earlier prompts again."""
        return [self._only_new(listener) for listener in self.live.listeners]

    def talk(self, person: Operator) -> Operator:
        """See OpenedSource."""
        return _ResumedOperator(person, self.bus)

    @contextmanager
    def measuring(self, capture: Path, say: Say, recorded: str) -> Iterator[ActiveSource]:
        """See OpenedSource."""
        with closing(self.bus), CaptureWriter(capture) as writer:
            writer.start({"mpucal": __version__, "recorded": recorded, **self.plan.meta(), **self.live.source_meta()})
            recorder = _Recorder(writer, UtcRecorder(writer), self.bus)
            driver = self.live.driver(Tap(self.bus, recorder), capture.name, lambda text: say(f"  {text}."))
            yield ActiveSource(driver, recorder.event, self.bus.go_on, self._late)

    def _late(self, late: bool) -> bool:
        return bool(self.bus.pending_events(LATE)) if self.bus.replaying else late

    def _only_new(self, listener: Callable[[Prompt], None]) -> Callable[[Prompt], None]:
        return lambda prompt: None if self.bus.replaying else listener(prompt)


class _Recorder:
    """Recorder of new accesses and events, without the replayed ones."""

    def __init__(self, writer: CaptureWriter, dated: UtcRecorder, bus: ChainedBus) -> None:
        self._writer, self._dated, self._bus = writer, dated, bus

    def transaction(self, transaction: Any) -> None:
        """See Recorder."""
        if not self._bus.replaying:
            self._dated.transaction(transaction)

    def event(self, name: str, t_ns: int, data: Mapping[str, Any]) -> None:
        """See Note."""
        if not self._bus.replaying:
            self._writer.event(name, t_ns, data)


class _ResumedOperator:
    """Operator whose earlier prompts and keys are in the captures."""

    def __init__(self, person: Operator, bus: ChainedBus) -> None:
        self._person, self._bus = person, bus

    def hear(self, output: Output) -> None:
        """Show an output if it is new."""
        if not self._bus.replaying:
            self._person.hear(output)

    def pressed(self) -> Sequence[Key]:
        """Return the recorded keys; after the replay, the pressed ones."""
        if self._bus.replaying:
            return [Key(event.data[KEY]) for event in self._bus.pending_events(KEY)]
        return self._person.pressed()


def open_resumed(folder: Path) -> ResumedChip:
    """Open the session in `folder` and the source that its first capture names.

    Raises
    ------
    UsageError : no session, or its source cannot be opened again. CaptureError : a damaged head.
    """
    files = captures_in(folder)
    if (folder / CAPTURE_OF_VEHICLE.name).exists():
        remedy = f"use `mpucal calibrate {folder}` for the recorded part; or start again"
        raise UsageError(f"the session in {folder} is one with a vehicle, which cannot be resumed", remedy)
    if not files:
        raise UsageError(f"{folder} does not hold a session", "give the folder of an interrupted session")
    captures = [read_capture(file) for file in files]
    plan = Plan.of_capture(captures[0].meta, captures[0].name)
    source = captures[0].meta.get(SOURCE)
    if not source:
        raise UsageError(f"the capture in {folder} does not name its source", "use `mpucal calibrate` on the folder")
    live = reopen_source(source, plan)
    if not isinstance(live, OpenedChip):
        raise UsageError(
            f"a session on the source of {folder} cannot be resumed", "use `mpucal calibrate` on the folder"
        )
    records = split_at_resumes((capture.records for capture in captures), more=True)
    last_ns = max((record.t_ns for part in records for record in part), default=0)
    replays = [ReplayBus(part, folder.name) for part in records]
    recovered = [capture.recovered for capture in captures if capture.recovered]
    return ResumedChip(
        ChainedBus([*replays, ShiftedClockBus(live.bus, last_ns)]),
        live,
        plan,
        recovered[-1] if recovered else None,
        CAPTURE.numbered(len(files) + 1),
        live.truth,
        live.real_time,
    )
