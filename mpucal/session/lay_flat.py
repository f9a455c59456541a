"""The first step of a session: wait until the board has been flat and still for long enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..data import Samples
from ..rests.flat import ENOUGH_FLAT_S
from ..rests.limits import QUIET
from ..rests.stillness import Detector, Moved, Sighting, Still
from ..rests.windows import WINDOW_S, Windows
from .aims import FLAT_S, SHORTEST_FLAT_S
from .boards import BOARD, KINDS
from .events import Caution, Countdown, Output, Outputs, Progress, Prompt, PromptKind, Rested, Stopped, triple
from .step import PATIENCE_S, SAY_AGAIN_S, Step

# Remedy for missing samples, for every source.
LOST = "check the wires or the link, end other programs, or take a lower --rate"

# For commands that need a board at rest, but no session.
STAND = Prompt(
    PromptKind.LAY_FLAT, "Put the vehicle on its feet on a firm surface, level if you can, and let go of it."
)
PUT_DOWN = Prompt(PromptKind.LAY_FLAT, "Put the board on a firm surface and let go of it.")


def put_down(
    listeners: Sequence[Callable[[Prompt], None]], say: Callable[[str], None], prompt: Prompt = PUT_DOWN
) -> None:
    """Prompt for a board at rest outside a session; `listeners` get the prompt as well."""
    say(prompt.text)
    for listener in listeners:
        listener(prompt)


class LayFlat(Step):
    """Step that waits for stillness, and says what disturbs it.

    Parameters
    ----------
    patient : there is no time limit, and once the board is moved, a rest of ENOUGH_FLAT_S is enough, as in a recording
        without a session, whose person knew of no countdown.
    board : its kind, for the words of the prompts. flat_s : time for which it is to be still.
    """

    def __init__(self, patient: bool = False, board: str = BOARD, flat_s: float = FLAT_S) -> None:
        self._patient, self._flat_s = patient, flat_s
        lay = KINDS[board].lay
        text = f"{lay} on a firm surface, let go of it, and leave it still for {flat_s:.0f} s."
        self.prompt = Prompt(PromptKind.LAY_FLAT, text)
        self._windows = Windows(WINDOW_S)
        silent = np.zeros(3)
        # In a shorter time a hand's tremor is not told from the noise of a sensor; an autopilot's streams have less.
        self._stillness = Detector(QUIET, (silent, silent) if flat_s < FLAT_S else None)
        self._still: Still | None = None
        self._begun_s: float | None = None
        self._cautioned_s = 0.0
        self._motion = ""

    def add(self, samples: Samples, sightings: Sequence[Sighting]) -> Outputs:
        """See Step; Rested or Stopped comes last and ends the step."""
        outputs: Outputs = []
        for window in self._windows.add(samples):
            if self._begun_s is None:
                self._begun_s = self._cautioned_s = window.start_s
            t_s, sight = window.end_s, self._stillness.add(window)
            if isinstance(sight, Moved):
                if self._patient and self._still is not None and self._still.seconds >= ENOUGH_FLAT_S:
                    return [*outputs, self._rested(self._still)]
                outputs += self._moved(sight, t_s)
                if not self._patient and t_s - self._begun_s >= PATIENCE_S:
                    return [*outputs, self._never_still(sight)]
                continue
            outputs += self._rests(sight, t_s)
            if sight.seconds >= self._flat_s - 1e-6:
                return [*outputs, self._rested(sight)]
        return outputs

    def resumed(self) -> Sequence[Output]:
        """See Step."""
        self._windows = Windows(WINDOW_S)
        self._stillness.forget()
        self._still, self._begun_s = None, None
        return super().resumed()

    def enough(self) -> Outputs:
        """Return the stillness so far, unless it is too short to go on with."""
        return [self._rested(self._still)] if self._still is not None and self._still.seconds >= SHORTEST_FLAT_S else []

    def _rested(self, still: Still) -> Rested:
        return Rested(still.seconds, triple(still.acc), triple(still.gyr))

    def _rests(self, still: Still, t_s: float) -> list[Output]:
        """Return the countdown, after a caution if the board was moved since it was still last."""
        outputs: list[Output] = []
        before, self._still = self._still, still
        if before is not None and still.run != before.run and before.seconds >= SHORTEST_FLAT_S:
            self._cautioned_s = t_s
            what, remedy = f"the board was moved: {self._motion}", "let go of it; the countdown starts again"
            outputs.append(Caution(t_s, "moved", what, remedy))
        return outputs + self._countdown(t_s, f"still for {still.seconds:.0f} of {self._flat_s:.0f} s", paused=False)

    def _moved(self, moved: Moved, t_s: float) -> list[Output]:
        self._motion = moved.what
        outputs = self._countdown(t_s, "waiting for the board to be still", paused=True)
        if moved.after_s >= SHORTEST_FLAT_S or t_s - self._cautioned_s >= SAY_AGAIN_S:
            self._cautioned_s = t_s
            remedy = LOST if moved.lost else "put it on a firm surface and let go of it"
            outputs.append(Caution(t_s, "trembling", f"not still: {moved.what}", remedy))
        return outputs

    def _countdown(self, t_s: float, text: str, paused: bool) -> list[Output]:
        still_s = min(self._stillness.seconds, self._flat_s)
        return [
            Countdown(t_s, self._flat_s - still_s, self._flat_s, paused),
            Progress(t_s, still_s, self._flat_s, text),
        ]

    def _never_still(self, moved: Moved) -> Stopped:
        return Stopped(
            f"the board was not still for {self._flat_s:.0f} s within {PATIENCE_S:.0f} s (last: {moved.what})",
            f"{LOST}, and start again"
            if moved.lost
            else "put it on a firm surface, away from vibration, and start again",
        )
