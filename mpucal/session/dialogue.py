"""The session machine between its person, its live fits and the samples: what happened goes in, in a fixed order.

What reaches the machine depends on the samples and the keys alone, so that a replay repeats it: an answer of the live
fits goes in after a fixed number of samples, and what arrives before it waits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from ..chip.records import FORGET, KEY, LATE
from ..data import Recording, Samples
from ..errors import Abandoned
from .events import (
    Abort,
    Command,
    Decision,
    Enough,
    Event,
    Forget,
    Key,
    Measured,
    Prompt,
    Redo,
    Tick,
)
from .live.questions import Questions
from .machine import Machine
from .ports import Note, Talk
from .table import State

MEASURING = (State.LAY_FLAT, State.ROTATE, State.VERIFY)
_PRESSED: dict[Key, Event] = {Key.ENOUGH: Enough(), Key.REDO: Redo(), Key.ABORT: Abort()}


class Dialogue:
    """One session's.

    Parameters
    ----------
    talk : the person. listeners : hear each prompt, too. note : keeps a session event in the capture.
    now_ns : the source's clock. late : see Runner.

    Attributes
    ----------
    questions : to the live fits; None until the sensor is known.
    interrupted : somebody stopped the session.
    """

    def __init__(
        self,
        machine: Machine,
        talk: Talk,
        listeners: Sequence[Callable[[Prompt], None]],
        note: Note,
        now_ns: Callable[[], int],
        late: Callable[[bool], bool],
    ) -> None:
        self._machine, self._talk, self._listeners = machine, talk, listeners
        self._note, self._now_ns, self._late = note, now_ns, late
        self.questions: Questions | None = None
        self.interrupted = False
        # what must not reach the machine before an answer that is late
        self._arrived: deque[Event] = deque()
        self._forgotten: list[Forget] = []
        self._said = Decision("")

    @property
    def state(self) -> State:
        """The machine's."""
        return self._machine.state

    @property
    def measuring(self) -> bool:
        """Whether the machine wants samples."""
        return self._machine.state in MEASURING

    def ask(self) -> None:
        """Take the keys that were pressed meanwhile; Abandoned where one of them ends the session."""
        for key in self._talk.pressed():
            self.press(key)

    def press(self, key: Key) -> None:
        """A key was pressed; a replay presses it in the same place."""
        self._note(KEY, self._now_ns(), {KEY: key.value})
        self.interrupted |= key is Key.ABORT
        if self._arrived and key is not Key.ABORT:
            self._arrived.append(_PRESSED[key])
        else:
            self.feed(_PRESSED[key])

    def arrive(self, samples: Samples) -> None:
        """The source delivered samples."""
        self._arrived += Measured(samples), Tick(self._now_ns() * 1e-9)
        self.catch_up()

    def catch_up(self, wait: bool = False) -> None:
        """Tell the machine what arrived, each answer in its place; where one is late, the source goes on meanwhile."""
        while self.measuring:
            if self.questions is not None and self.questions.due:
                if not wait and self._late(self.questions.late):
                    self._note(LATE, self._now_ns(), {})
                    return
                for answer in self.questions.answers():
                    if self.measuring:
                        self.feed(answer)
            elif self._arrived:
                event = self._arrived.popleft()
                if self.questions is not None and isinstance(event, Measured):
                    self.questions.add(event.samples)
                self.feed(event)
            else:
                return
        self._arrived.clear()

    def feed(self, event: Event) -> None:
        """Tell the machine, and everybody what it answers.

        Raises
        ------
        Abandoned : the session ends here without a result.
        """
        for output in self._machine.handle(event):
            if isinstance(output, Command):
                self._do(output)
                continue
            if isinstance(output, Decision):
                self._said = output
            self._talk.hear(output)
            if isinstance(output, Prompt):
                for listener in self._listeners:
                    listener(output)
        if self._machine.state is State.ABORTED:
            raise Abandoned(self._said.why, self._said.remedy)

    def remembered(self, recording: Recording) -> Recording:
        """All samples but those that the person did not want."""
        for forget in sorted(self._forgotten, key=lambda f: f.first, reverse=True):
            recording = recording.without(forget.first, forget.last)
        return recording

    def _do(self, command: Command) -> None:
        """What the machine asks of its owner."""
        if isinstance(command, Forget):
            self._forgotten = [f for f in self._forgotten if f.first != command.first] + [command]
            self._note(FORGET, self._now_ns(), {"first": command.first, "last": command.last})
            if self.questions is not None:
                self.questions.forget(command.first)
        elif self.questions is not None:
            self.questions.ask(command)
