"""Runs a session or a recording from its source's first byte to the files that it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..chip.records import KEY, RESUMED
from ..data import Recording, Sensor
from ..errors import Abandoned, BusError, CaptureError, ChipError, EndOfCapture
from ..result.calibration import Calibration
from .dialogue import Dialogue
from .events import Connected, Fitted, Key, Prompt, Resumed, SourceEnded, Written
from .live.questions import Here, Questions, Worker
from .live.verdict import verified
from .machine import Machine
from .plan import Plan
from .ports import Note, Source, Talk
from .results import result_files, save
from .table import State


class Runner:
    """Runs one session on one source; every step is asked for in the order in which it stands here.

    What reaches the machine depends on the source's bytes and the keys alone, so that a replay repeats it.

    Parameters
    ----------
    talk : the person. note : keeps a session event in the capture (name, time [ns], data).
    plan : what the session is to do.
    listeners : hear each prompt besides the person: the hand that turns a simulated board.
    go_on : after the source has ended, lets it go on with the next part of what was recorded in parts: True where
        there is one. The last part of a resumed session is the sensor itself.
    late : whether to wait for an answer that is late now, or is not; in a replay, where its session waited.
    hire : begins who computes the answers. checking : a calibration that is there is checked; nothing is computed
        meanwhile.
    """

    def __init__(
        self,
        source: Source,
        talk: Talk,
        note: Note,
        plan: Plan | None = None,
        listeners: Sequence[Callable[[Prompt], None]] = (),
        go_on: Callable[[], bool] = lambda: False,
        late: Callable[[bool], bool] = bool,
        hire: Callable[[Plan, Sensor], Worker] = Here,
        checking: bool = False,
    ) -> None:
        self._source, self._talk, self._note = source, talk, note
        self._plan = plan = plan or Plan()
        self._go_on, self._hire, self._checking = go_on, hire, checking
        self._machine = Machine(plan.until_end, plan.target, plan.tilt_only, plan.attended, checking)
        self._dialogue = Dialogue(self._machine, talk, listeners, note, source.now_ns, late)
        self._ended = False
        self.sensor: Sensor | None = None

    def measure(self) -> Recording:
        """Connect, lay flat, rotate, verify.

        Raises
        ------
        Abandoned : the person stopped it, never held still, or the source ended before the board was turned.
        SourceError : the source failed before the board was turned, or does not replay.
        """
        try:
            self._dialogue.ask()
            self._connect()
            if self.sensor is not None and not self._checking:
                self._dialogue.questions = Questions(self._plan, self.sensor, self._hire)
            while self._dialogue.measuring:
                self._step()
        except Abandoned:
            # a replay that is stopped by who watches it went on when it was recorded
            with suppress(CaptureError):
                self._rest()
            raise
        finally:
            if self._dialogue.questions is not None:
                self._dialogue.questions.close()
        self._rest()
        return self._dialogue.remembered(self._source.recording())

    def record(self, seconds: float | None) -> int:
        """Measure for `seconds`, or until any key or the source's end; returns how many samples came.

        Raises
        ------
        SourceError : the source failed before the board was turned.
        """
        if self._plan.config.accel_only:
            return self._collect(seconds)
        self._connect()
        begun_ns = self._source.now_ns()
        long_ns = math.inf if seconds is None else seconds * 1e9
        while self._dialogue.measuring:
            if self._talk.pressed() or self._source.now_ns() - begun_ns >= long_ns:
                self._stop_here()
                break
            self._poll()
        self._rest()
        return len(self._source.recording())

    def calibrate(self, recording: Recording, fit: Callable[[Recording], Calibration]) -> Calibration:
        """Fit, and join what the verification found; Abandoned where the person stopped it meanwhile."""
        calibration = verified(fit(recording), self._machine.checked)
        self._dialogue.ask()
        self._dialogue.feed(Fitted(calibration.verdict))
        return calibration

    def write(
        self,
        folder: Path,
        calibration: Calibration,
        recording: Recording,
        truth: Mapping[str, Any] | None = None,
    ) -> tuple[Path, ...]:
        """Write the results, all files or none; Abandoned where the person stopped it.

        Raises
        ------
        OutputError : a file cannot be written.
        """
        files: dict[str, bytes] = {}
        for name, data in result_files(calibration, recording, truth):
            self._dialogue.ask()
            files[name] = data
        written = save(folder, files)
        self._dialogue.ask()
        self._dialogue.feed(Written(tuple(files)))
        return written

    def _collect(self, seconds: float | None) -> int:
        """The same without a prompt: of the accelerometer alone no session is made."""
        with suppress(EndOfCapture):
            self.sensor = self._source.start()
            end_ns = math.inf if seconds is None else self._source.now_ns() + seconds * 1e9
            while self._source.now_ns() < end_ns and not self._talk.pressed():
                self._source.poll()
            self._stop_here()
            self._source.stop()
        return len(self._source.recording())

    def _stop_here(self) -> None:
        """As by a key: a session that replays this goes on to calibrate, or has nothing to."""
        if self._dialogue.state is State.ROTATE:
            self._dialogue.press(Key.ENOUGH)
        else:
            self._note(KEY, self._source.now_ns(), {KEY: Key.ABORT.value})

    def _connect(self) -> None:
        try:
            self.sensor = self._source.start()
        except EndOfCapture:
            self._ends(SourceEnded())
        else:
            self._dialogue.feed(Connected(self.sensor))

    def _step(self) -> None:
        """Take what came; where a session ended early, and was resumed, it goes on there."""
        try:
            self._dialogue.ask()
            if self._dialogue.measuring:
                self._poll()
        except Abandoned:
            if self._dialogue.interrupted or not self._next_part():
                raise

    def _poll(self) -> None:
        try:
            samples = self._source.poll()
        except EndOfCapture:
            self._ends(SourceEnded())
        except (BusError, ChipError) as error:
            # a CaptureError is none of these: what does not replay is not calibrated either
            self._ends(SourceEnded(f"{error.what}: {error.remedy}"), error)
        else:
            self._dialogue.arrive(samples)

    def _ends(self, event: SourceEnded, error: BusError | ChipError | None = None) -> None:
        """That was all, or all of one part: what ended that does not end a session that was resumed."""
        self._dialogue.catch_up(wait=True)
        enough = self.sensor is not None and not self._dialogue.measuring
        if not enough and self._next_part():
            return
        self._ended = True
        if enough:
            return
        if error is not None and self._dialogue.state not in (State.ROTATE, State.VERIFY):
            raise error
        self._dialogue.feed(event)

    def _next_part(self) -> bool:
        """Go on with the next part of a resumed session; False where there is none."""
        ended_ns = self._source.now_ns()
        while self._go_on():
            self._note(RESUMED, ended_ns, {})
            try:
                sensor = self._source.start()
            except EndOfCapture:
                continue
            gap_s = (self._source.now_ns() - ended_ns) * 1e-9
            self._dialogue.feed(Connected(sensor) if self.sensor is None else Resumed(gap_s))
            self.sensor = sensor
            return True
        return False

    def _rest(self) -> None:
        if self._ended:
            return
        # the samples are in: a sensor that cannot be put to rest takes nothing from them
        with suppress(BusError, ChipError, EndOfCapture):
            self._source.stop()
