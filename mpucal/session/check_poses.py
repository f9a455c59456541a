"""The second step of `mpucal check`: three orientations of the person's choice, 20 deg or more apart."""

from __future__ import annotations

import numpy as np

from ..data import Samples
from .aims import ALL_AROUND
from .boards import BOARD, describe
from .coverage import Directions
from .events import Caution, Finished, Output, Progress, Prompt, PromptKind, Rested, Use, triple
from .pauses import PATIENCE_S, Pause, PoseStep, classify_use, countdown, held

ORIENTATIONS = 3
# A check has few samples: a longer hold averages the hand's tremor.
CHECK_HOLD_S = 2.0
# Weight that prefers, of both directions along an axis, the one that is farther from all others.
OTHER_WAY = 0.1


class CheckPoses(PoseStep):
    """Step that asks for the orientations that would show most, and takes any new one."""

    def __init__(self, flat: Rested, board: str = BOARD) -> None:
        super().__init__(flat, CHECK_HOLD_S)
        self._board = board
        self._shown = Directions()
        self._shown.add(np.array(flat.acc))
        self.prompt = self._next()

    def add(self, samples: Samples) -> list[Output | Finished]:
        """Return the outputs for `samples`; Finished comes last and ends the step."""
        t_s = float(samples.t[-1])
        if self._begun_s is None:
            self._begun_s = self._prompted_s = t_s
        outputs: list[Output | Finished] = []
        for pause in self._pauses.add(samples):
            if self._number < ORIENTATIONS:
                outputs += self._hold(pause)
        if self._number == ORIENTATIONS:
            return [*outputs, Finished(f"{ORIENTATIONS} orientations: done")]
        if t_s - self._begun_s >= PATIENCE_S:
            return [*outputs, Finished(f"no new orientation for {PATIENCE_S:.0f} s")]
        return [*outputs, *self._remind(t_s, self._prompted_s, "no new orientation for a while")]

    def _hold(self, pause: Pause) -> list[Output]:
        new = not self._shown.near(pause.acc)
        use = classify_use(pause.acc, self.prompt.down, new) if new else Use.SEEN
        outputs: list[Output] = [*countdown(pause, use)]
        if pause.seconds < CHECK_HOLD_S - 1e-6:
            return outputs
        self._pauses.leave(pause.run)
        self._prompted_s = pause.t_s
        outputs.append(held(pause, use))
        if not new:
            seen = Caution(pause.t_s, "seen_already", "this orientation was shown already", self.prompt.text)
            return [*outputs, seen]
        self._shown.add(pause.acc)
        self._number += 1
        self._begun_s = pause.t_s
        outputs.append(Progress(pause.t_s, self._number, ORIENTATIONS, f"held {self._number} of {ORIENTATIONS}"))
        if self._number < ORIENTATIONS:
            self.prompt = self._next()
            outputs.append(self.prompt)
        return outputs

    def _next(self) -> Prompt:
        """Return a prompt for the axis that differs most from all orientations shown: a bias shows along either way."""
        along = -ALL_AROUND @ self._shown.units.T
        down = ALL_AROUND[int((np.abs(along).max(1) + OTHER_WAY * along.max(1)).argmin())]
        number = f"{self._number + 1} of {ORIENTATIONS}"
        words = describe(triple(down), self._board)
        text = f"Orientation {number}: {words}, or any other new one, then hold it still for 2 s."
        return Prompt(PromptKind.VERIFY, text, triple(down))
