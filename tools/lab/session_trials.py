"""Whole sessions on the simulated chip, one a seed: how long they take, how they end, and how right they are.

python -m tools.lab session_trials --seeds 50
python -m tools.lab session_trials --seeds 50 --hand placing random wandering --json trials.json
python -m tools.lab session_trials --sabotage

The hand that follows the guidance is compared with hands that turn as they like. All times are simulated seconds since
the start.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import Abandoned
from mpucal.session.events import Decision, Key, Knowledge, Meter, Output, Prompt, PromptKind, Verification
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.sensor import SensorTruth
from tools.lab.study.metrics import sph_rms

# what changes while the board is turned is seen by what was turned, or by what verifies it
CHANGED = "inconsistent", "verification_failed"
# name: what comes after --bus, options of the chip, and which reason is to be given first
SABOTAGE: dict[str, tuple[str, dict[str, Any], tuple[str, ...]]] = {
    "never still": ("sim:hand=restless", {}, ("never_still",)),
    "one orientation": ("sim:hand=still", {}, ("few_orientations",)),
    "one axis": ("sim:hand=one_axis", {}, ("few_orientations",)),
    "flipped axis": ("sim:D=1/0/0/0/-1/0/0/0/1", {}, ("left_handed",)),
    "swapped axes": ("sim:D=0/1/0/1/0/0/0/0/-1", {}, ("swapped_axes",)),
    "wrong range": ("sim:D=2/0/0/0/2/0/0/0/2", {}, ("wrong_range",)),
    "gyro clipping": ("sim:hand=hasty", {"gyro_range_dps": 250}, ("gyro_clipped",)),
    "a knock": ("sim:hand=knocking", {}, CHANGED),
    "a slip": ("sim:hand=slipping", {}, CHANGED),
    "warming by 15 C": ("sim:hand=warming", {}, ("temperature_moved",)),
}


@dataclass(frozen=True)
class Trial:
    """How one session ended; times in simulated seconds, NaN where it did not come so far."""

    seed: int
    verdict: str
    reasons: tuple[str, ...]
    rotated_s: float = math.nan
    finished_s: float = math.nan
    prompts: int = 0
    known: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    sph_rms: float = math.nan
    z: tuple[float, ...] = ()
    z_verified: tuple[float, ...] = ()
    cautions: tuple[str, ...] = ()
    why: tuple[str, ...] = ()


class Witness:
    """Hears a session, presses nothing, and remembers when what was said."""

    def __init__(self) -> None:
        self.t_s = 0.0
        self.heard: list[tuple[float, Output]] = []

    def hear(self, output: Output) -> None:
        """Remember."""
        if isinstance(output, Meter):
            self.t_s = output.t_s
        else:
            self.heard.append((self.t_s, output))

    def pressed(self) -> Sequence[Key]:
        """Nothing."""
        return ()

    def of(self, kind: type) -> list[tuple[float, Any]]:
        """Time and output of all of a kind."""
        return [(t_s, output) for t_s, output in self.heard if isinstance(output, kind)]

    def when(self, kind: PromptKind) -> float:
        """When that was first asked for."""
        return next((t_s for t_s, prompt in self.of(Prompt) if prompt.kind is kind), math.nan)


def run(bus_words: str, plan: Plan, seed: int) -> Trial:
    """One session."""
    bus = open_simulated(bus_words, plan.gravity, seed)
    witness = Witness()
    runner = Runner(Driver(bus, plan.config), witness, lambda *_: None, plan, (bus.hear,))
    try:
        recording = runner.measure()
    except Abandoned as error:
        return Trial(seed, "abandoned", ("never_still",) if "not still" in str(error) else (), why=(str(error),))
    calibration = runner.calibrate(recording, partial(calibrate, model=plan.model, gravity=plan.gravity))
    truth = bus.truth_document() or {}
    D, b_a = np.array(truth["D"]), np.array(truth["b_a"])
    known = witness.of(Knowledge)[-1:]
    rotated_s = witness.when(PromptKind.VERIFY)
    finished_s = witness.when(PromptKind.REST)
    return Trial(
        seed,
        calibration.verdict,
        tuple(reason["code"] for reason in calibration.quality["reasons"]),
        finished_s if math.isnan(rotated_s) else rotated_s,
        finished_s,
        sum(prompt.kind is PromptKind.ROTATE for _, prompt in witness.of(Prompt)),
        tuple(max(v) for _, k in known for v in (k.gain_pct, k.misalignment_deg, k.bias_mg)) or (math.nan,) * 3,
        sph_rms(SensorTruth(D, b_a, np.eye(3), np.zeros(3), plan.gravity), calibration.D, calibration.b_a),
        tuple(((calibration.D - D) / calibration.D_std).ravel().tolist())
        + tuple(((calibration.b_a - b_a) / calibration.b_a_std).tolist()),
        tuple(
            z
            for _, v in witness.of(Verification)
            for z in (v.magnitude_mps2 / v.magnitude_std_mps2, v.direction_deg / v.direction_std_deg)
        ),
        tuple(reason["message"] for reason in calibration.quality["reasons"])
        + tuple(decision.why for _, decision in witness.of(Decision)),
    )


def all_of(bus_words: str, plan: Plan, seeds: Sequence[int], jobs: int) -> list[Trial]:
    """One session a seed, side by side."""
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        return list(pool.imap(partial(run, bus_words, plan), seeds))


HEAD = (
    "hand             good       rotated [s]      finished [s]      sph_rms [m/s2]      z  z verify  asked\n"
    "                          median (worst)    median (worst)        mean (worst)    rms       rms  median"
)


def row(name: str, trials: Sequence[Trial]) -> str:
    """A line of the table: medians and worst."""
    good = sum(trial.verdict == "good" for trial in trials)
    z = np.array([v for trial in trials for v in trial.z])
    verified = np.array([v for trial in trials for v in trial.z_verified])
    rotated, finished, sph = (np.array([getattr(t, k) for t in trials]) for k in ("rotated_s", "finished_s", "sph_rms"))
    return (
        f"{name:<12}{good:>4} of {len(trials):<3}"
        f"{np.nanmedian(rotated):>8.1f} ({np.nanmax(rotated):>5.1f})  "
        f"{np.nanmedian(finished):>8.1f} ({np.nanmax(finished):>5.1f})"
        f"{np.nanmean(sph):>11.4f} ({np.nanmax(sph):.4f})"
        f"{_rms(z):>7.2f}{_rms(verified):>10.2f}{np.median([t.prompts for t in trials]):>7.0f}"
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2))) if len(values) else math.nan


def sabotage(plan: Plan, seed: int) -> dict[str, Trial]:
    """One session for each that cannot end well."""
    found = {}
    for name, (bus_words, options, _) in SABOTAGE.items():
        found[name] = run(bus_words, Plan(Config(**options), plan.gravity, target=plan.target), seed)
    return found


def main() -> int:
    """Run them; 1 where a session ended as it should not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--hand", nargs="*", default=["guided"])
    parser.add_argument("--target", default="normal")
    parser.add_argument("--tilt-only", action="store_true")
    parser.add_argument("--sabotage", action="store_true", help="sessions that must be refused, each for its reason")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    parser.add_argument("--verbose", action="store_true", help="a line a session")
    arguments = parser.parse_args()
    model = "tilt" if arguments.tilt_only else "auto"
    plan = Plan(model=model, target=arguments.target, tilt_only=arguments.tilt_only)
    if arguments.sabotage:
        wrong = 0
        for name, trial in sabotage(plan, arguments.first).items():
            expected = SABOTAGE[name][2]
            as_it_should = trial.verdict in ("refused", "abandoned") and trial.reasons[:1] in [(c,) for c in expected]
            wrong += not as_it_should
            print(f"{'ok ' if as_it_should else 'NOT'} {name:<16} {trial.verdict:<10} {', '.join(trial.reasons)}")
            print(f"    {trial.why[0] if trial.why else ''}")
        return min(wrong, 1)
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    results = {hand: all_of(f"sim:hand={hand}", plan, seeds, arguments.jobs) for hand in arguments.hand}
    if arguments.verbose:
        for hand, trials in results.items():
            for trial in trials:
                print(f"{hand} {row(str(trial.seed), [trial])} {trial.verdict} {' '.join(trial.reasons)}")
    print(HEAD)
    for hand, trials in results.items():
        print(row(hand, trials))
    if arguments.json:
        document = {hand: [asdict(trial) for trial in trials] for hand, trials in results.items()}
        arguments.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 0
