"""Is a calibration called good though the sensor changed midway? Simulated hands, with and without a change.

python tools/changes.py --runs 12
python tools/changes.py --scenario continuous --runs 20 --json changes.json
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from monte_carlo import in_parallel
from rich.console import Console
from rich.table import Table
from tables import number

import mpucal
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.simulated.study.metrics import sph_rms
from mpucal.simulated.study.scenarios import GRAVITY_MPS2, MOTIONS, hand_scenario

# (what changes, by how much: deg, m/s^2, deg/s), about a random axis
CHANGES = (("nothing", 0.0), ("mount", 4.0), ("accelerometer", 0.5), ("accelerometer", 1.0), ("gyroscope", 3.0))
CHANGED_AT = 0.6  # of the recording
RATE_HZ = 100.0
FALSE_FACTOR = 3.0


@dataclass(frozen=True)
class Run:
    """The verdict on a recording; false : good, and yet worse than three times its claim."""

    scenario: str
    change: tuple[str, float]
    seed: int
    verdict: str
    codes: tuple[str, ...]
    sph_rms: float
    claimed: float
    false: bool


def changed(recording: Recording, change: tuple[str, float], seed: int) -> Recording:
    """The recording with its sensor changed from CHANGED_AT on."""
    what, size = change
    axis = np.random.default_rng(seed).standard_normal(3)
    axis /= np.linalg.norm(axis)
    acc, gyr, at = recording.acc.copy(), recording.gyr.copy(), int(CHANGED_AT * len(recording))
    if what == "mount":
        acc[at:] = acc[at:] @ rotation(np.radians(size) * axis).T
    elif what == "accelerometer":
        acc[at:] += size * axis
    elif what == "gyroscope":
        gyr[at:] += np.radians(size) * axis
    return replace(recording, acc=acc, gyr=gyr)


def judged(item: tuple[str, tuple[str, float], int], model: str) -> Run:
    """Simulate, change, calibrate."""
    scenario, change, seed = item
    simulated = hand_scenario(seed, scenario, rate_hz=RATE_HZ)
    result = mpucal.calibrate(changed(simulated.recording, change, seed), model=model, gravity=GRAVITY_MPS2)
    error, claimed = sph_rms(simulated.truth, result.D, result.b_a), float(result.quality["error_std"]["rms"])
    false = result.verdict == "good" and error > FALSE_FACTOR * claimed
    codes = tuple(reason["code"] for reason in result.quality["reasons"])
    return Run(scenario, change, seed, result.verdict, codes, error, claimed, false)


def table(title: str, runs: Sequence[Run]) -> Table:
    """A line for each scenario and change."""
    lines = Table("scenario", "changed", title=title)
    for column in ("good", "usable", "refused", "inconsistent", "falsely good", "sph_rms of those, worst"):
        lines.add_column(column, justify="right")
    for key in dict.fromkeys((run.scenario, run.change) for run in runs):
        of = [run for run in runs if (run.scenario, run.change) == key]
        what, size = key[1]
        unit = {"mount": "deg", "accelerometer": "m/s²", "gyroscope": "deg/s"}.get(what)
        false = [run.sph_rms for run in of if run.false]
        lines.add_row(
            key[0],
            f"{what}, {size:g} {unit}" if unit else what,
            *(str(sum(run.verdict == verdict for run in of)) for verdict in ("good", "usable", "refused")),
            str(sum("inconsistent" in run.codes for run in of)),
            str(len(false)),
            number(max(false)) if false else "",
        )
    lines.caption = f"falsely good: called so, and worse than {FALSE_FACTOR:g} times what it claims"
    return lines


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenario", action="append", choices=MOTIONS, help="may be given more than once")
    parser.add_argument("--runs", type=int, default=12, help="seeds of each scenario and change")
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--model", default="auto")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    options.scenario = options.scenario or ["continuous", "wobble30", "pose12"]
    return options


def main() -> None:
    """Simulate, print and save."""
    options = arguments()
    seeds = range(options.seed, options.seed + options.runs)
    items = [(scenario, change, seed) for scenario in options.scenario for change in CHANGES for seed in seeds]
    runs = list(in_parallel(partial(judged, model=options.model), items, options.jobs, "changes"))
    Console(width=130).print(table(f"a sensor that changes midway, {options.model}, {options.runs} seeds", runs))
    if options.json:
        options.json.write_text(json.dumps([asdict(run) for run in runs], indent=1).replace("NaN", "null") + "\n")


if __name__ == "__main__":
    main()
