"""Sessions on the simulated chip with damage that nobody announces: does any end good, and far from the truth?

python -m tools.lab damage_trials --seeds 40
python -m tools.lab damage_trials --seeds 200 --first 1000 --damage zero --json trials.json

Damage begins at a random time while the board is turned or verified: a step of 3 to 30 mg of the accelerometer's bias
in any direction (zero), a low byte that is lost (byte), one byte in 2,000 with a flipped bit (bits), or nothing (none).
A table counts verdicts by the error of a calibrated reading, rms over the sphere, in units of what is claimed. Of a
bias that stepped both sides count as true, and the error is that of the nearer one.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Vector
from mpucal.errors import Abandoned
from mpucal.result.error_model import MG_PER_MPS2
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.mishaps import ZeroStep
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms

DAMAGES = "zero", "byte", "bits", "none"
FAULTS = {"byte": "low_byte", "bits": "bit_errors"}
BEGIN_S, END_S = 12.0, 75.0
STEP_MG = 3.0, 30.0
# what is claimed may be wrong by so much, and no more
MOST_STD = 4.0
BINS = (1.0, 2.0, 3.0, 4.0, math.inf)


@dataclass(frozen=True)
class Trial:
    """How one session ended: error [m/s^2], and in units of what is claimed."""

    seed: int
    damage: str
    at_s: float
    verdict: str
    reasons: tuple[str, ...] = ()
    error: float = math.nan
    z: float = math.nan

    @property
    def wrong(self) -> bool:
        """Called good, and far from what it claims."""
        return self.verdict == "good" and self.z > MOST_STD


class Nobody:
    """Hears, and presses nothing."""

    def hear(self, output: object) -> None:
        """Be told."""

    def pressed(self) -> Sequence[object]:
        """Nothing."""
        return ()


def run(damage: str, rate_hz: float, seed: int) -> Trial:
    """One session."""
    rng = np.random.default_rng([seed, DAMAGES.index(damage)])
    at_s = round(float(rng.uniform(BEGIN_S, END_S)), 1)
    direction = rng.normal(size=3)
    step = direction / np.linalg.norm(direction) * math.exp(rng.uniform(*np.log(STEP_MG))) / MG_PER_MPS2
    words = f"sim:fault={FAULTS[damage]}@{at_s}" if damage in FAULTS else "sim"
    zero = ZeroStep(step)
    if damage == "zero":
        zero.begin(at_s)
    plan = Plan(Config(rate_hz=rate_hz))
    bus = open_simulated(words, plan.gravity, seed, mishaps=(zero,))
    runner = Runner(Driver(bus, plan.config), Nobody(), lambda *_: None, plan, (bus.hear,))
    try:
        recording = runner.measure()
    except Abandoned:
        return Trial(seed, damage, at_s, "abandoned")
    found = runner.calibrate(recording, partial(calibrate, model=plan.model, gravity=plan.gravity))
    codes = tuple(reason["code"] for reason in found.quality["reasons"])
    truth = bus.truth_document() or {}
    steps: list[Vector] = [np.zeros(3), step] if damage == "zero" and recording.t[-1] > at_s else [np.zeros(3)]
    # the mishap is felt before D
    biases = [np.array(truth["b_a"]) + np.array(truth["D"]) @ each for each in steps]
    error = min(_error(np.array(truth["D"]), b_a, found.D, found.b_a, plan.gravity) for b_a in biases)
    return Trial(seed, damage, at_s, found.verdict, codes, error, error / found.quality["error_std"]["rms"])


def _error(D: Vector, b_a: Vector, found_D: Vector, found_b_a: Vector, gravity: float) -> float:
    return sph_rms(SensorTruth(D, b_a, np.eye(3), np.zeros(3), gravity), found_D, found_b_a)


def table(trials: Sequence[Trial]) -> str:
    """Verdicts by error in units of what is claimed."""
    head = " ".join(f"<= {b:g}".rjust(6) if math.isfinite(b) else " more " for b in BINS)
    lines = [f"{'damage':<8}{'verdict':<11}{'all':>5}  {head}   worst [m/s2]  reasons"]
    for damage in dict.fromkeys(t.damage for t in trials):
        for verdict in ("good", "usable", "refused", "abandoned"):
            some = [t for t in trials if (t.damage, t.verdict) == (damage, verdict)]
            if not some:
                continue
            places = Counter(next((i for i, b in enumerate(BINS) if t.z <= b), len(BINS) - 1) for t in some)
            counts = " ".join(f"{places[i]:>6}" for i in range(len(BINS)))
            named = Counter(code for t in some for code in t.reasons[:1])
            worst = max((t.error for t in some), default=math.nan)
            words = ", ".join(f"{code} {n}" for code, n in named.most_common())
            lines.append(f"{damage:<8}{verdict:<11}{len(some):>5}  {counts}   {worst:>12.4f}  {words}")
    return "\n".join(lines)


def main() -> int:
    """Run them; 1 where one is good and wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40, help="of each damage")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--damage", nargs="*", choices=DAMAGES, default=DAMAGES)
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    with multiprocessing.get_context("spawn").Pool(arguments.jobs) as pool:
        trials = [t for d in arguments.damage for t in pool.imap(partial(run, d, arguments.rate), seeds)]
    print(table(trials))
    for trial in trials:
        if trial.wrong:
            print(f"WRONG {trial.damage} seed {trial.seed} at {trial.at_s} s: {trial.error:.4f}, {trial.z:.1f} std")
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(t) for t in trials], indent=1) + "\n", encoding="utf-8")
    return int(any(trial.wrong for trial in trials))
