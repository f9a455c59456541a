"""Do published elements hold a sensor that changed? Its bias, scale factors or mount change midway in a hand.

python -m tools.lab changes --seeds 0:40

Each element of D and b_a is to lie within its standard uncertainties of what the sensor was before or after the change,
or between. `python -m tools.lab campaign` judges alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import mpucal
from mpucal.calibration.rotation import rotation
from mpucal.data import Vector

from .judge import Judgement, judged
from .runner import Asked, Program
from .scenarios.faults import MG_MPS2
from .scenarios.recordings import hand_scenario
from .table import Column, count, grouped, over, show, table

# ranges of the changes, drawn uniformly in their logarithm: mg, mg, 1, deg
KINDS = {"none": (0.0, 0.0), "bias": (2.0, 50.0), "drift": (2.0, 20.0), "scale": (1e-3, 1e-2), "mount": (0.3, 3.0)}
MOTION, RATE_HZ = "pose12", 100.0
FAR = 4.0


@dataclass(frozen=True)
class Run(Judgement):
    """Result for a sensor that changed: the kind of change, and the number of elements that are far off."""

    kind: str = ""
    seed: int = 0

    @property
    def far(self) -> int:
        """Return the number of elements more than FAR standard uncertainties off."""
        return sum(abs(z) > FAR for z in self.z)


def of_item(item: tuple[str, int]) -> Run:
    """Simulate a recording, change its sensor, calibrate and compare."""
    kind, seed = item
    simulated, rng = hand_scenario(seed, MOTION, rate_hz=RATE_HZ), np.random.default_rng(seed)
    recording, D, b_a = simulated.recording, simulated.truth.D, simulated.truth.b_a
    t = recording.t - recording.t[0]
    share = (t > rng.uniform(0.2, 0.9) * t[-1]) if kind != "drift" else t / t[-1]
    after = _changed(kind, D, b_a, rng)
    # y = D s + b_a, less its noise
    s = np.linalg.solve(D, (recording.acc - b_a).T).T
    acc = recording.acc + share[:, None] * (s @ (after[0] - D).T + after[1] - b_a)
    result = mpucal.calibrate(replace(recording, acc=acc), gravity=simulated.truth.gravity)
    return Run(**vars(judged(result, (D, b_a), after)), kind=kind, seed=seed)


def _changed(kind: str, D: Vector, b_a: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Return D and b_a after a change of random size and direction."""
    least, most = KINDS[kind]
    size = least * (most / least) ** rng.uniform() if least else 0.0
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    if kind == "scale":
        return np.diag(1.0 + size * direction) @ D, b_a
    if kind == "mount":
        return D @ rotation(np.radians(size) * direction), b_a
    return D, b_a + MG_MPS2 * size * direction


COLUMNS: dict[str, Column] = {
    "runs": len,
    **{verdict: count("verdict", verdict) for verdict in ("good", "usable", "refused")},
    "false": lambda runs: sum(run.false for run in runs),
    f"good elements beyond {FAR:g}": lambda runs: sum(run.far for run in runs if run.verdict == "good"),
    f"usable elements beyond {FAR:g}": lambda runs: sum(run.far for run in runs if run.verdict == "usable"),
    "farthest": over("farthest", max),
}


def report(runs: list[Run], asked: Asked) -> None:
    """Print a line for each kind of change."""
    show(table(grouped(runs, "kind"), COLUMNS, f"sensors that changed, {MOTION} at {RATE_HZ:g} Hz"))


main = Program(
    __doc__, of_item, items=lambda asked: [(kind, seed) for kind in KINDS for seed in asked.seeds], report=report
)
