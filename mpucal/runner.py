"""Where source, session, person, fit and files meet. Knows no terminal and no kind of source."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from .bus.records import SessionEvent
from .chip.access import EndOfCapture
from .data import Recording, Samples, Sensor
from .errors import Abandoned, BusError, CaptureError, ChipError
from .result import Calibration
from .session.events import (
    Abort,
    Connected,
    Decision,
    Enough,
    Event,
    Fitted,
    Key,
    Measured,
    Output,
    Prompt,
    SourceEnded,
    Tick,
    Written,
)
from .session.machine import Machine
from .session.table import State
from .sinks.file import result_files, save

MEASURING = (State.LAY_FLAT, State.ROTATE)
KEY = "key"
_PRESSED: dict[Key, Event] = {Key.ENOUGH: Enough(), Key.ABORT: Abort()}


class Source(Protocol):
    """What delivers samples: the chip's driver, over whatever bus."""

    def start(self) -> Sensor:
        """Set the sensor up and begin to measure."""
        ...

    def poll(self) -> Samples:
        """Wait a little, and return the samples that came meanwhile; EndOfCapture if there will be none."""
        ...

    def recording(self) -> Recording:
        """All samples so far, with their final times."""
        ...

    def now_ns(self) -> int:
        """The source's clock, in which the samples' times are."""
        ...

    def stop(self) -> None:
        """Put the sensor to rest."""
        ...


class Talk(Protocol):
    """The person: who is told, and who says."""

    def hear(self, output: Output) -> None:
        """Be told."""
        ...

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call; never waits."""
        ...


class Replayed:
    """The person in a capture: presses the recorded keys where they were pressed. Somebody else listens.

    Parameters
    ----------
    listener : hears, and may abort. pending : the session events recorded since the last access, each once.
    """

    def __init__(self, listener: Talk, pending: Callable[[], Sequence[SessionEvent]]) -> None:
        self._listener, self._pending = listener, pending

    def hear(self, output: Output) -> None:
        """Be told."""
        self._listener.hear(output)

    def pressed(self) -> Sequence[Key]:
        """The recorded keys, and a listener's abort."""
        recorded = [Key(event.data[KEY]) for event in self._pending() if event.name == KEY]
        return [*recorded, *(key for key in self._listener.pressed() if key is Key.ABORT)]


Note = Callable[[str, int, Mapping[str, Any]], None]


class Runner:
    """Runs one session on one source; every step is asked for in the order in which it stands here.

    What reaches the machine depends on the source's bytes and the keys alone, so that a replay repeats it.

    Parameters
    ----------
    talk : the person. note : keeps a session event in the capture (name, time [ns], data).
    until_end : see Machine.
    listeners : hear each prompt besides the person: the hand that turns a simulated board.
    """

    def __init__(
        self,
        source: Source,
        talk: Talk,
        note: Note,
        until_end: bool = False,
        listeners: Sequence[Callable[[Prompt], None]] = (),
    ) -> None:
        self._source = source
        self._talk = talk
        self._note = note
        self._listeners = listeners
        self._machine = Machine(until_end)
        self._said = Decision("")
        self._ended = False
        self.sensor: Sensor | None = None

    def measure(self) -> Recording:
        """Connect, lay flat, rotate.

        Raises
        ------
        Abandoned : the person stopped it, never held still, or the source ended before the board was turned.
        SourceError : the source failed before the board was turned, or does not replay.
        """
        try:
            self._ask()
            self._connect()
            while self._machine.state in MEASURING:
                self._ask()
                if self._machine.state in MEASURING:
                    self._poll()
        except Abandoned:
            # a replay that is stopped by who watches it went on when it was recorded
            with suppress(CaptureError):
                self._rest()
            raise
        self._rest()
        return self._source.recording()

    def record(self, seconds: float | None) -> int:
        """Measure for `seconds`, or until any key or the source's end; returns how many samples came.

        Raises
        ------
        SourceError : the source failed before the board was turned.
        """
        self._connect()
        begun_ns = self._source.now_ns()
        long_ns = math.inf if seconds is None else seconds * 1e9
        while self._machine.state in MEASURING:
            if self._talk.pressed() or self._source.now_ns() - begun_ns >= long_ns:
                # as a key: a session that replays this goes on to calibrate, or has nothing to
                with suppress(Abandoned):
                    self._press(Key.ENOUGH if self._machine.state is State.ROTATE else Key.ABORT)
                break
            self._poll()
        self._rest()
        return len(self._source.recording())

    def calibrate(self, recording: Recording, fit: Callable[[Recording], Calibration]) -> Calibration:
        """Fit; Abandoned where the person stopped it meanwhile."""
        calibration = fit(recording)
        self._ask()
        self._feed(Fitted(calibration.verdict))
        return calibration

    def write(
        self,
        folder: Path,
        calibration: Calibration,
        recording: Recording,
        truth: Mapping[str, Any] | None = None,
    ) -> tuple[Path, ...]:
        """Write the results, each file whole or not at all; Abandoned where the person stopped it.

        Raises
        ------
        OutputError : a file cannot be written.
        """
        written: list[Path] = []
        for name, data in result_files(calibration, recording, truth):
            self._ask()
            written.append(save(folder, name, data))
        self._ask()
        self._feed(Written(tuple(path.name for path in written)))
        return tuple(written)

    def _connect(self) -> None:
        try:
            self.sensor = self._source.start()
        except EndOfCapture:
            self._ended = True
            self._feed(SourceEnded())
        else:
            self._feed(Connected(self.sensor))

    def _poll(self) -> None:
        try:
            samples = self._source.poll()
        except EndOfCapture:
            self._ended = True
            self._feed(SourceEnded())
        except (BusError, ChipError) as error:
            self._ended = True
            # a CaptureError is none of these: what does not replay is not calibrated either
            if self._machine.state is not State.ROTATE:
                raise
            self._feed(SourceEnded(error.what))
        else:
            self._feed(Measured(samples))
            if self._machine.state in MEASURING:
                self._feed(Tick(self._source.now_ns() * 1e-9))

    def _rest(self) -> None:
        if self._ended:
            return
        # the samples are in: a sensor that cannot be put to rest takes nothing from them
        with suppress(BusError, ChipError, EndOfCapture):
            self._source.stop()

    def _ask(self) -> None:
        for key in self._talk.pressed():
            self._press(key)

    def _press(self, key: Key) -> None:
        self._note(KEY, self._source.now_ns(), {KEY: key.value})
        self._feed(_PRESSED[key])

    def _feed(self, event: Event) -> None:
        for output in self._machine.handle(event):
            if isinstance(output, Decision):
                self._said = output
            self._talk.hear(output)
            if isinstance(output, Prompt):
                for listener in self._listeners:
                    listener(output)
        if self._machine.state is State.ABORTED:
            raise Abandoned(self._said.why, self._said.remedy)
