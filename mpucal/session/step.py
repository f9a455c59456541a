"""Base of a session's steps: samples, answers of fits and keys in; outputs, and the event that ends the step, out."""

from __future__ import annotations

from collections.abc import Sequence

from ..data import Samples
from .events import Checked, Direction, Finished, Learnt, Output, Prompt, Rested, Stopped, Tried, Turned

# Events that end a step; such an event comes last in its outputs.
End = Rested | Turned | Finished | Stopped
ENOUGH = "you chose to go on"
# Least time between two cautions of one kind.
SAY_AGAIN_S = 5.0


class Step:
    """Step of a session.

    Attributes
    ----------
    prompt : the last one. checked : result of the verification; None before it is known, or if the person skipped it.
    """

    prompt: Prompt
    checked: Checked | None = None

    @property
    def wanted(self) -> Direction | None:
        """Unit vector that is to point down; None if no orientation is asked for."""
        return self.prompt.down

    def begin(self) -> Sequence[Output]:
        """Return the first outputs."""
        return [self.prompt]

    def add(self, samples: Samples) -> Sequence[Output | End]:
        """Return the outputs for `samples`."""
        raise NotImplementedError

    def answer(self, event: Learnt | Tried | Checked) -> Sequence[Output | End]:
        """Return the outputs for the answer of a fit; none if another step requested it."""
        return []

    def enough(self) -> Sequence[End]:
        """Return the end of the step at the person's wish, if there is enough to go on with."""
        return [Finished(ENOUGH)]

    def resumed(self) -> Sequence[Output]:
        """Start again after a gap, in which the board may have been moved."""
        return [self.prompt]
