"""Runner of a session or a recording, from its source's first byte to its files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from ..chip.access import KEY, RESUMED, SAMPLED_NS
from ..data import Recording, Sensor
from ..errors import Abandoned, BusError, CaptureError, ChipError, EndOfCapture, SourceError
from ..result.calibration import Calibration
from .dialogue import Dialogue
from .events import Connected, Fitted, Key, Prompt, Resumed, SourceEnded, Written
from .live_scheduler import FitScheduler, InlineWorker, Worker
from .live_verification import add_verification
from .machine import Machine
from .plan import Plan
from .ports import Note, Operator, Source
from .results import save
from .table import State


class Runner:
    """Runner of one session on one source: call measure, calibrate and write in this order, or record alone.

    What reaches the state machine depends on the source's bytes and the keys alone, so that a replay repeats it.

    Parameters
    ----------
    operator : the person. note : writes a session event into the capture (name, time [ns], data).
    plan : settings of the session.
    listeners : called with each prompt, such as the hand that turns a simulated board.
    open_next_part : called when the source has ended; returns True if another recorded part continues the session.
        The last part of a resumed session is the sensor itself.
    late : decides what to do while an answer is due: called with True if it is not computed yet; returns True to poll
        the source meanwhile. In a replay it returns what it returned in the recorded session.
    start_worker : makes the worker that executes the live fits.
    checking : an existing calibration is checked; there are no live fits.
    """

    def __init__(
        self,
        source: Source,
        operator: Operator,
        note: Note,
        plan: Plan | None = None,
        listeners: Sequence[Callable[[Prompt], None]] = (),
        open_next_part: Callable[[], bool] = lambda: False,
        late: Callable[[bool], bool] = bool,
        start_worker: Callable[[Plan, Sensor], Worker] = InlineWorker,
        checking: bool = False,
    ) -> None:
        self._source, self._operator, self._note = source, operator, note
        self._plan = plan = plan or Plan()
        self._open_next_part, self._start_worker, self._checking = open_next_part, start_worker, checking
        self._machine = Machine(plan, checking)
        self._dialogue = Dialogue(self._machine, operator, listeners, note, source.now_ns, late)
        self._ended, self._recording, self.samples = False, False, 0
        self._interrupted_ns: list[int] = []
        self.sensor: Sensor | None = None

    def measure(self) -> Recording:
        """Connect, lay flat, rotate, verify; return the samples.

        Raises
        ------
        Abandoned : the person stopped it or never held still, or the source ended before the board was turned.
        SourceError : the source failed before the board was turned, or does not replay.
        """
        try:
            self._dialogue.take_keys()
            self._connect()
            if self.sensor is not None and not self._checking:
                self._dialogue.scheduler = FitScheduler(self._plan, self.sensor, self._start_worker)
            while self._dialogue.measuring:
                self._step()
        except Abandoned:
            # Where a viewer stops a replay, the recorded session went on: its capture holds no stop.
            with suppress(CaptureError):
                self._stop_source()
            raise
        finally:
            if self._dialogue.scheduler is not None:
                self._dialogue.scheduler.close()
        self._stop_source()
        recording = self._dialogue.without_forgotten(self._source.recording())
        return recording.interrupted_at(*(t_ns * 1e-9 for t_ns in self._interrupted_ns))

    def record(self, seconds: float | None) -> int:
        """Measure for `seconds`, or until any key or the source's end; return the number of samples.

        The samples are in the capture, and are not kept: a recording may last for days.

        Raises
        ------
        SourceError : the source failed, or sent no samples for seconds.
        """
        self._recording = True
        self._connect()
        begun_ns = self._source.now_ns()
        long_ns = math.inf if seconds is None else seconds * 1e9
        while self._dialogue.measuring:
            if self._operator.pressed() or self._source.now_ns() - begun_ns >= long_ns:
                self._end_recording()
                break
            self._poll()
            self._source.forget()
        else:
            # The sensor was silent for too long, or a replay has ended.
            if not self._ended:
                self._stop_source()
                raise SourceError(self._dialogue.decision.why, "check the wiring, and record again")
        self._stop_source()
        return self.samples

    def calibrate(self, recording: Recording, fit: Callable[[Recording], Calibration]) -> Calibration:
        """Fit, and add the result of the verification; Abandoned if the person stopped it meanwhile."""
        calibration = add_verification(fit(recording), self._machine.checked)
        self._dialogue.take_keys()
        self._dialogue.feed(Fitted(calibration.verdict))
        return calibration

    def write(self, folder: Path, files: Iterable[tuple[str, bytes]]) -> tuple[Path, ...]:
        """Write the results as they are made, by name: all files or none; Abandoned if the person stopped it.

        Raises
        ------
        OutputError : a file cannot be written.
        """
        made: dict[str, bytes] = {}
        for name, data in files:
            self._dialogue.take_keys()
            made[name] = data
        written = save(folder, made)
        self._dialogue.take_keys()
        self._dialogue.feed(Written(tuple(made)))
        return written

    def _end_recording(self) -> None:
        """Write a key into the capture: a replay then calibrates what was recorded, or aborts if that is too little."""
        key = Key.ENOUGH if self._dialogue.state is State.ROTATE else Key.ABORT
        self._note(KEY, self._source.now_ns(), {KEY: key.value})

    def _connect(self) -> None:
        try:
            self.sensor = self._source.start()
        except EndOfCapture:
            self._source_ended(SourceEnded())
        else:
            self._dialogue.feed(Connected(self.sensor))

    def _step(self) -> None:
        """Process keys and one poll; where a resumed session had been abandoned, continue with its next part."""
        try:
            self._dialogue.take_keys()
            if self._dialogue.measuring:
                self._poll()
        except Abandoned:
            if self._dialogue.interrupted or not self._next_part():
                raise

    def _poll(self) -> None:
        try:
            samples = self._source.poll()
        except EndOfCapture:
            self._source_ended(SourceEnded())
        except (BusError, ChipError) as error:
            # A CaptureError is not caught: a capture that does not replay is not calibrated.
            self._source_ended(SourceEnded(f"{error.what}: {error.remedy}"), error)
        else:
            self.samples += len(samples)
            self._dialogue.arrive(samples)

    def _source_ended(self, event: SourceEnded, error: BusError | ChipError | None = None) -> None:
        """Continue with the next part of a resumed session; else tell the machine, or raise `error`."""
        self._dialogue.catch_up(wait=True)
        enough = self.sensor is not None and not self._dialogue.measuring
        if not enough and self._next_part():
            return
        self._ended = True
        if enough:
            return
        if error is not None and (self._recording or self._dialogue.state not in (State.ROTATE, State.VERIFY)):
            raise error
        self._dialogue.feed(event)

    def _next_part(self) -> bool:
        """Continue with the next part of a resumed session; return False if there is none."""
        ended_ns = self._source.now_ns()
        while self._open_next_part():
            self._note(RESUMED, ended_ns, {SAMPLED_NS: ended_ns})
            self._interrupted_ns.append(ended_ns)
            try:
                sensor = self._source.start()
            except EndOfCapture:
                continue
            self._dialogue.feed(Connected(sensor) if self.sensor is None else Resumed())
            self.sensor = sensor
            return True
        return False

    def _stop_source(self) -> None:
        if self._ended:
            return
        # The samples are safe: a sensor that cannot be put to rest does no harm to them.
        with suppress(BusError, ChipError, EndOfCapture):
            self._source.stop()
