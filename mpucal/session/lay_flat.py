"""The first step of a session: wait until the board has been flat and still for ten seconds."""

from __future__ import annotations

import numpy as np

from ..data import Samples
from ..rests.limits import QUIET
from ..rests.stillness import Detector, Moved, Still
from ..rests.windows import Windows
from .events import Caution, Countdown, Output, Progress, Prompt, PromptKind, Rested, Stopped

WINDOW_S = 0.5
FLAT_S = 10.0
# What a person may cut it short to, by a key.
SHORTEST_S = 2.0
# What a recording may hold of it, whose person was told nothing.
RECORDED_S = 5.0
PATIENCE_S = 60.0
# Stillness shorter than this is not worth saying that it was interrupted ...
WORTH_SAYING_S = 1.0
# ... and a board that keeps moving is spoken of this often.
SAY_AGAIN_S = 5.0
# what helps where samples are missing, of any source
LOST = "check the wires or the link, end other programs, or take a lower --rate"

PROMPT = Prompt(
    PromptKind.LAY_FLAT,
    f"Lay the board flat on a firm surface, let go of it, and leave it still for {FLAT_S:.0f} s.",
)


class LayFlat:
    """Waits for stillness, and says what disturbs it; `patient`: for ever, and a shorter one will do as it ends."""

    def __init__(self, patient: bool = False) -> None:
        self._patient = patient
        self._windows = Windows(WINDOW_S)
        self._stillness = Detector(QUIET)
        self._still: Still | None = None
        self._begun_s: float | None = None
        self._spoke_s = 0.0
        self._shaken = ""

    def add(self, samples: Samples) -> list[Output | Rested | Stopped]:
        """What `samples` show; Rested or Stopped comes last and ends the step."""
        found: list[Output | Rested | Stopped] = []
        for window in self._windows.add(samples):
            if self._begun_s is None:
                self._begun_s = self._spoke_s = window.start_s
            t_s, sight = window.end_s, self._stillness.add(window)
            if isinstance(sight, Moved):
                if self._patient and self._still is not None and self._still.seconds >= RECORDED_S:
                    return [*found, self._rested(self._still)]
                found += self._moved(sight, t_s)
                if not self._patient and t_s - self._begun_s >= PATIENCE_S:
                    return [*found, _never_still(sight)]
                continue
            found += self._rests(sight, t_s)
            if sight.seconds >= FLAT_S - 1e-6:
                return [*found, self._rested(sight)]
        return found

    def resumed(self) -> list[Output]:
        """The board may be anywhere now."""
        self._windows = Windows(WINDOW_S)
        self._stillness.forget()
        self._still, self._begun_s = None, None
        return [PROMPT]

    def enough(self) -> Rested | None:
        """The stillness so far, where there is enough of it to go on with."""
        if self._still is None or self._still.seconds < SHORTEST_S:
            return None
        return self._rested(self._still)

    def _rested(self, still: Still) -> Rested:
        x, y, z, *rates = np.concatenate([still.acc, still.gyr]).tolist()
        return Rested(still.seconds, (x, y, z), (rates[0], rates[1], rates[2]))

    def _rests(self, still: Still, t_s: float) -> list[Output]:
        """Still, perhaps again, and perhaps elsewhere."""
        found: list[Output] = []
        before, self._still = self._still, still
        if before is not None and still.run != before.run and before.seconds >= WORTH_SAYING_S:
            self._spoke_s = t_s
            found.append(
                Caution(
                    t_s, "moved", f"the board was moved: {self._shaken}", "let go of it; the countdown starts again"
                )
            )
        remaining = max(FLAT_S - still.seconds, 0.0)
        return [
            *found,
            Countdown(t_s, remaining, FLAT_S, paused=False),
            self._progress(t_s, f"still for {still.seconds:.0f} of {FLAT_S:.0f} s"),
        ]

    def _moved(self, moved: Moved, t_s: float) -> list[Output]:
        self._shaken = moved.what
        found: list[Output] = [
            Countdown(t_s, max(FLAT_S - self._stillness.seconds, 0.0), FLAT_S, paused=True),
            self._progress(t_s, "waiting for the board to be still"),
        ]
        if moved.after_s >= WORTH_SAYING_S or t_s - self._spoke_s >= SAY_AGAIN_S:
            self._spoke_s = t_s
            remedy = LOST if moved.lost else "put it on a firm surface and let go of it"
            found.append(Caution(t_s, "trembling", f"not still: {moved.what}", remedy))
        return found

    def _progress(self, t_s: float, text: str) -> Progress:
        return Progress(t_s, min(self._stillness.seconds, FLAT_S), FLAT_S, text)


def _never_still(moved: Moved) -> Stopped:
    return Stopped(
        f"the board was not still for {FLAT_S:.0f} s within {PATIENCE_S:.0f} s (last: {moved.what})",
        f"{LOST}, and start again" if moved.lost else "put it on a firm surface, away from vibration, and start again",
    )
