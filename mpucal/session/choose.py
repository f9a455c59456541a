"""The second step of a check: three orientations of the person's choice, each 20 deg or more from the others."""

from __future__ import annotations

import numpy as np

from ..data import Samples
from ..result.orientation import side_down
from .aims import ALL_AROUND
from .coverage import Coverage
from .events import Caution, Direction, Finished, Output, Progress, Prompt, PromptKind, Rested, Use
from .pauses import Pause, Pauses, counted, held, use_of

ORIENTATIONS = 3
# a tremor averages out, and a check has little else to go by
CHECK_HOLD_S = 2.0
PATIENCE_S = 40.0
SAY_AGAIN_S = 8.0
# of two orientations along axes equally new, the one that is farther from all others
OTHER_WAY = 0.1


class Choose:
    """Asks for what would show most, and takes whatever is new.

    Parameters
    ----------
    flat : how the board lay.

    Attributes
    ----------
    prompt : the last one.
    """

    def __init__(self, flat: Rested) -> None:
        self._coverage = Coverage()
        self._coverage.pauses(np.array(flat.acc))
        self._pauses = Pauses(flat, CHECK_HOLD_S)
        self._begun_s: float | None = None
        self._said_s = 0.0
        self._number = 0
        self.prompt = self._next()

    @property
    def wanted(self) -> Direction | None:
        """What is to point down."""
        return self.prompt.down

    def add(self, samples: Samples) -> list[Output | Finished]:
        """What `samples` show; Finished comes last and ends the step."""
        t_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._said_s = t_s
        found: list[Output | Finished] = []
        for pause in self._pauses.add(samples):
            if self._number < ORIENTATIONS:
                found += self._hold(pause)
        if self._number == ORIENTATIONS:
            return [*found, Finished(f"{ORIENTATIONS} orientations: done")]
        if t_s - self._begun_s >= PATIENCE_S:
            return [*found, Finished(f"no new orientation for {PATIENCE_S:.0f} s")]
        if t_s - self._said_s >= SAY_AGAIN_S:
            self._said_s = t_s
            found.append(Caution(t_s, "not_turned", "no new orientation for a while", self.prompt.text))
        return found

    def resumed(self) -> list[Output]:
        """The board may be anywhere now."""
        self._begun_s = None
        self._pauses.forget()
        return [self.prompt]

    def _hold(self, pause: Pause) -> list[Output]:
        new = self._coverage.is_new(pause.acc)
        use = use_of(pause.acc, self.prompt.down, new) if new else Use.SEEN
        found: list[Output] = [*counted(pause, use)]
        if pause.seconds < CHECK_HOLD_S - 1e-6:
            return found
        self._pauses.leave(pause.run)
        self._said_s = pause.t_s
        if not new:
            seen = Caution(pause.t_s, "seen_already", "this orientation was shown already", self.prompt.text)
            return [*found, held(pause, use), seen]
        self._coverage.pauses(pause.acc)
        self._number += 1
        self._begun_s = pause.t_s
        said = Progress(pause.t_s, self._number, ORIENTATIONS, f"held {self._number} of {ORIENTATIONS}")
        if self._number == ORIENTATIONS:
            return [*found, held(pause, use), said]
        self.prompt = self._next()
        return [*found, held(pause, use), said, self.prompt]

    def _next(self) -> Prompt:
        """The axis least like all that was shown: a bias is seen along it, one way up or the other."""
        along = -ALL_AROUND @ self._coverage.paused.units.T
        down = ALL_AROUND[int((np.abs(along).max(1) + OTHER_WAY * along.max(1)).argmin())]
        x, y, z = np.asarray(down).tolist()
        number = f"{self._number + 1} of {ORIENTATIONS}"
        text = f"Orientation {number}: {side_down(down)} down, or any other new one, then hold it still for 2 s."
        return Prompt(PromptKind.VERIFY, text, (x, y, z))
