"""Order of a session's events: samples, keys and answers of the live fits, on their way to the state machine.

The order depends on the samples and the keys alone, so that a replay repeats it: an answer of the live fits goes in
after a fixed number of samples, and later events wait for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from ..chip.access import FORGET, KEY, LATE
from ..data import Recording, Samples
from ..errors import Abandoned
from .events import Abort, Command, Decision, Enough, Event, Forget, Key, Measured, Prompt, Redo, Tick
from .live_scheduler import FitScheduler
from .machine import Machine
from .ports import Note, Operator
from .table import MEASURING, State

_PRESSED: dict[Key, Event] = {Key.ENOUGH: Enough(), Key.REDO: Redo(), Key.ABORT: Abort()}


class Dialogue:
    """Owner of the state machine: gives it events, and distributes its outputs.

    Parameters
    ----------
    operator : the person. listeners : called with each prompt. note : writes a session event into the capture.
    now_ns : the source's clock. late : see Runner.

    Attributes
    ----------
    scheduler : of the live fits; None until the sensor is known. interrupted : somebody stopped the session.
    decision : the latest.
    """

    def __init__(
        self,
        machine: Machine,
        operator: Operator,
        listeners: Sequence[Callable[[Prompt], None]],
        note: Note,
        now_ns: Callable[[], int],
        late: Callable[[bool], bool],
    ) -> None:
        self._machine, self._operator, self._listeners = machine, operator, listeners
        self._note, self._now_ns, self._late = note, now_ns, late
        self.scheduler: FitScheduler | None = None
        self.interrupted = False
        # Events that must not reach the machine before an answer that is late.
        self._arrived: deque[Event] = deque()
        self._forgotten: dict[int, int] = {}
        self.decision = Decision("")

    @property
    def state(self) -> State:
        """State of the machine."""
        return self._machine.state

    @property
    def measuring(self) -> bool:
        """True if the machine needs samples."""
        return self._machine.state in MEASURING

    def take_keys(self) -> None:
        """Process the keys that were pressed since the last call; Abandoned if one of them ends the session."""
        for key in self._operator.pressed():
            self.press(key)

    def press(self, key: Key) -> None:
        """Process a key, and write it into the capture, so that a replay has it in the same place."""
        self._note(KEY, self._now_ns(), {KEY: key.value})
        self.interrupted |= key is Key.ABORT
        if self._arrived and key is not Key.ABORT:
            self._arrived.append(_PRESSED[key])
        else:
            self.feed(_PRESSED[key])

    def arrive(self, samples: Samples) -> None:
        """Process the samples of one poll."""
        self._arrived += Measured(samples), Tick(self._now_ns() * 1e-9)
        self.catch_up()

    def catch_up(self, wait: bool = False) -> None:
        """Give the machine what arrived, with each answer in its place.

        If an answer is late, return, so that the source is polled meanwhile; with `wait`, wait for it.
        """
        while self.measuring:
            if self.scheduler is not None and self.scheduler.due:
                if not wait and self._late(self.scheduler.late):
                    self._note(LATE, self._now_ns(), {})
                    return
                for answer in self.scheduler.answers():
                    if self.measuring:
                        self.feed(answer)
            elif self._arrived:
                event = self._arrived.popleft()
                if self.scheduler is not None and isinstance(event, Measured):
                    self.scheduler.add(event.samples)
                self.feed(event)
            else:
                return
        self._arrived.clear()

    def feed(self, event: Event) -> None:
        """Give the machine an event, and distribute its outputs.

        Raises
        ------
        Abandoned : the session ends here without a result.
        """
        for output in self._machine.handle(event):
            if isinstance(output, Command):
                self._execute(output)
                continue
            if isinstance(output, Decision):
                self.decision = output
            self._operator.hear(output)
            if isinstance(output, Prompt):
                for listener in self._listeners:
                    listener(output)
        if self._machine.state is State.ABORTED:
            raise Abandoned(self.decision.why, self.decision.remedy)

    def without_forgotten(self, recording: Recording) -> Recording:
        """Return the recording without the samples that the machine had dropped."""
        return recording.without(self._forgotten)

    def _execute(self, command: Command) -> None:
        if isinstance(command, Forget):
            self._forgotten[command.first] = command.last
            self._note(FORGET, self._now_ns(), {"first": command.first, "last": command.last})
            if self.scheduler is not None:
                self.scheduler.forget(command.first)
        elif self.scheduler is not None:
            self.scheduler.request(command)
