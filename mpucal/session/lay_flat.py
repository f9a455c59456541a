"""The first step of a session: the board lies flat and still for ten seconds. Knows no other step."""

from __future__ import annotations

from ..data import Samples
from .events import Output, Progress, Prompt, PromptKind, Rested, Stopped
from .stillness import ON_A_TABLE, Moved, Still, Stillness
from .windows import Windows

WINDOW_S = 0.5
FLAT_S = 10.0
# What a person may cut it short to, by a key.
SHORTEST_S = 2.0
PATIENCE_S = 60.0
# Stillness shorter than this is not worth saying that it was interrupted ...
WORTH_SAYING_S = 1.0
# ... and a board that keeps moving is spoken of this often.
SAY_AGAIN_S = 5.0

PROMPT = Prompt(
    PromptKind.LAY_FLAT,
    f"Lay the board flat on something firm and let go of it, until it has been still for {FLAT_S:.0f} s.",
)


class LayFlat:
    """Waits for stillness, and says what disturbs it; `patient`: for ever."""

    def __init__(self, patient: bool = False) -> None:
        self._patient = patient
        self._windows = Windows(WINDOW_S)
        self._stillness = Stillness(ON_A_TABLE)
        self._still: Still | None = None
        self._begun_s: float | None = None
        self._spoke_s = 0.0

    def add(self, samples: Samples) -> list[Output | Rested | Stopped]:
        """What `samples` show; Rested or Stopped comes last and ends the step."""
        found: list[Output | Rested | Stopped] = []
        for window in self._windows.add(samples):
            if self._begun_s is None:
                self._begun_s = self._spoke_s = window.start_s
            sight = self._stillness.add(window)
            if isinstance(sight, Still):
                self._still = sight
                found.append(self._progress(window.end_s, f"still for {sight.seconds:.0f} of {FLAT_S:.0f} s"))
                if sight.seconds >= FLAT_S - 1e-6:
                    return [*found, self._rested(sight)]
                continue
            self._still = None
            found.append(self._moved(sight, window.end_s))
            if not self._patient and window.end_s - self._begun_s >= PATIENCE_S:
                return [*found, _never_still(sight)]
        return found

    def enough(self) -> Rested | None:
        """The stillness so far, where there is enough of it to go on with."""
        if self._still is None or self._still.seconds < SHORTEST_S:
            return None
        return self._rested(self._still)

    def _rested(self, still: Still) -> Rested:
        x, y, z = still.acc.tolist()
        return Rested(still.seconds, (x, y, z))

    def _moved(self, moved: Moved, t_s: float) -> Output:
        if moved.after_s >= WORTH_SAYING_S or t_s - self._spoke_s >= SAY_AGAIN_S:
            self._spoke_s = t_s
            return Prompt(PromptKind.LAY_FLAT, f"Not still: {moved.what}. Let go of it; the ten seconds start again.")
        return self._progress(t_s, "waiting until it is still")

    def _progress(self, t_s: float, text: str) -> Progress:
        return Progress(t_s, min(self._stillness.seconds, FLAT_S), FLAT_S, text)


def _never_still(moved: Moved) -> Stopped:
    return Stopped(
        f"the board was not still for {FLAT_S:.0f} s within {PATIENCE_S:.0f} s (last, {moved.what})",
        "lay it on something firm, away from what shakes it, and start again",
    )
