"""Are the claimed standard deviations true? D and b_a of two halves of a recording, and of simulations and their truth.

python -m tools.lab halves recordings/*.npz                       real recordings, cut in the middle of a rest
python -m tools.lab halves --simulate --runs 20                   simulated ones, against their truth
python -m tools.lab halves --simulate --scenario wobble100 --json halves.json
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import mpucal
from mpucal.calibration import MODELS, weigh
from mpucal.calibration.fit import Fit
from mpucal.calibration.flat_segment import find_flat, flat_statistics
from mpucal.calibration.masks import with_masks
from mpucal.calibration.static_intervals import static_intervals
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Vector
from mpucal.errors import MpucalError, RecordingError
from tools.lab.study.scenarios import GRAVITY_MPS2, MOTIONS, Simulated, hand_scenario, paper_scenario
from tools.lab.study.sensors import hand_sensor, paper_sensor

from .monte_carlo import in_parallel
from .tables import number

# of 12 parameters each: what an honest claim gives, and what is wanted of the median and of the worst
MEDIAN, WORST = (0.7, 1.3), 2.0
LEAST_REST_S = 1.0
SCENES = ("paper", "paper, gyro off", *MOTIONS)


@dataclass(frozen=True)
class Agreement:
    """How far two estimates, or one and the truth, are apart in units of what they claim.

    Attributes
    ----------
    name : of the recording, or of the scenario and its seed. model : that made the estimate, or both with a stroke.
    z : rms over D and b_a. largest : the largest of the twelve, in absolute value.
    why : the sentence that says why there is none; None where there is one.
    """

    name: str
    model: str
    z: float = np.nan
    largest: float = np.nan
    why: str | None = None


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """Both halves of a recording, each of which begins at rest.

    The cut is in the middle of the rest nearest to the middle. Where the board rests only at the start and at the end,
    it is in the middle, and the second half is read backwards: gravity and accelerations are the same then, rates are
    reversed.

    Raises
    ------
    RecordingError : the board rests neither at the start nor at the end.
    """
    recording = with_masks(recording)
    flat = recording.flat or find_flat(recording)
    if flat is None:
        raise RecordingError(f"{recording.name}: no rest to begin with", "give a recording that begins at rest")
    runs = static_intervals(recording, flat_statistics(recording, flat))
    runs = runs[runs[:, 1] - runs[:, 0] >= LEAST_REST_S * recording.rate_hz]
    n, middle = len(recording), (flat[1] + len(recording)) // 2
    inner = runs[(runs[:, 0] > flat[1]) & (np.abs(runs.mean(1) - middle) < 0.25 * n)]
    if len(inner):
        first, last = min(inner.tolist(), key=lambda run: abs(sum(run) // 2 - middle))
        cut = (first + last) // 2
        return replace(recording.part(0, cut), flat=flat), replace(recording.part(cut, n), flat=(0, last - cut))
    # a rest that began before the cut is cut, too
    first, last = np.maximum(runs[-1], middle).tolist() if len(runs) else (n, n)
    if last < 0.9 * n or last - first < LEAST_REST_S * recording.rate_hz:
        raise RecordingError(f"{recording.name}: no second rest", "give a recording that ends at rest")
    backwards = reversed_in_time(recording.part(middle, n))
    return replace(recording.part(0, middle), flat=flat), replace(backwards, flat=(n - last, n - first))


def reversed_in_time(recording: Recording) -> Recording:
    """The same motion backwards."""
    mask = recording.gap
    return replace(
        recording,
        t=recording.t[-1] - recording.t[::-1],
        acc=recording.acc[::-1].copy(),
        gyr=-recording.gyr[::-1],
        temperature_c=recording.temperature_c[::-1].copy(),
        # samples missing before one are missing after it, backwards
        gap=np.append(False, mask[:0:-1]),
        acc_clipped=recording.acc_clipped[::-1].copy(),
        gyr_clipped=recording.gyr_clipped[::-1].copy(),
        flat=None,
    )


def estimated(recording: Recording, model: str, gravity: float) -> tuple[Fit, str]:
    """The fit with its covariance, and the model that made it.

    Raises
    ------
    RecordingError : nothing could be estimated.
    """
    evidence, chosen = weigh(recording, model, gravity)
    if evidence.fit is None:
        raise RecordingError(f"{recording.name}: nothing could be estimated", "see what `mpucal calibrate` says of it")
    return evidence.fit, chosen["model"]


def apart(name: str, model: str, difference: Vector, covariance: Vector) -> Agreement:
    """The twelve differences (12,) of D row-major and b_a against their covariance (12, 12)."""
    z = difference / np.sqrt(np.diag(covariance))
    return Agreement(name, model, float(np.sqrt(np.mean(z * z))), float(np.abs(z).max()))


def twelve(D: Vector, b_a: Vector) -> Vector:
    """(12,) D row-major and b_a, as a fit's covariance has them."""
    return np.append(D.ravel(), b_a)


def of_file(path: Path, model: str, gravity: float) -> Agreement:
    """How well the halves of a recorded file agree."""
    try:
        (one, of_one), (other, of_other) = (estimated(half, model, gravity) for half in halves(mpucal.load(path)))
    except MpucalError as error:
        return Agreement(path.stem, model, why=str(error))
    difference = twelve(one.D, one.b_a) - twelve(other.D, other.b_a)
    covariance = one.covariance[:12, :12] + other.covariance[:12, :12]
    return apart(path.stem, of_one if of_one == of_other else f"{of_one}/{of_other}", difference, covariance)


def simulate(scene: str, seed: int) -> Simulated:
    """The recording of a seed."""
    if scene == "paper":
        return paper_scenario(seed)
    if scene == "paper, gyro off":
        of_sensor, of_gyro = np.random.default_rng(seed).spawn(2)
        sensor = replace(paper_sensor(of_sensor), K=hand_sensor(of_gyro).K)
        return paper_scenario(seed, sensor=sensor)
    return hand_scenario(seed, scene)


def of_seed(item: tuple[str, int], model: str) -> Agreement:
    """How well a simulation's estimate agrees with its truth."""
    scene, seed = item
    simulated = simulate(scene, seed)
    try:
        fit, used = estimated(simulated.recording, model, GRAVITY_MPS2)
    except MpucalError as error:
        return Agreement(scene, model, why=str(error))
    difference = twelve(fit.D, fit.b_a) - twelve(simulated.truth.D, simulated.truth.b_a)
    return apart(scene, used, difference, fit.covariance[:12, :12])


def table(title: str, agreements: Sequence[Agreement]) -> Table:
    """One line a recording, or a scenario of many seeds."""
    lines = Table("recording", "model", title=title)
    for column in ("runs", "rms z, median", "rms z, worst", "largest |z|"):
        lines.add_column(column, justify="right")
    for name in dict.fromkeys(a.name for a in agreements):
        of_name = [a for a in agreements if a.name == name]
        for model in dict.fromkeys(a.model for a in of_name):
            _add(lines, name, model, [a for a in of_name if a.model == model])
    lines.add_section()
    for model in sorted({a.model for a in agreements}):
        _add(lines, "all", model, [a for a in agreements if a.model == model])
    lines.caption = f"wanted: median {MEDIAN[0]} to {MEDIAN[1]}, worst {WORST:g} or less"
    return lines


def _add(lines: Table, name: str, model: str, of: list[Agreement]) -> None:
    z = np.array([a.z for a in of if a.why is None])
    if len(z) == 0:
        lines.add_row(name, model, str(len(of)), "-", "-", of[0].why)
        return
    largest = max(a.largest for a in of if a.why is None)
    lines.add_row(name, model, str(len(of)), number(float(np.median(z))), number(float(z.max())), number(largest))


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="*", type=Path, help="files that mpucal reads")
    parser.add_argument("--simulate", action="store_true", help="simulated recordings against their truth")
    parser.add_argument("--scenario", action="append", choices=SCENES, help="may be given more than once; none: all")
    parser.add_argument("--runs", type=int, default=10, help="seeds of each scenario")
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--model", choices=MODELS, default="auto")
    parser.add_argument("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2, of the recordings")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    if not options.recordings and not options.simulate:
        parser.error("give recordings, or --simulate")
    return options


def main() -> None:
    """Cut, estimate, compare, print and save."""
    options = arguments()
    console = Console(width=120)
    document: dict[str, Any] = {}
    if options.recordings:
        one = partial(of_file, model=options.model, gravity=options.gravity)
        halved = list(in_parallel(one, options.recordings, options.jobs, "halves"))
        console.print(table(f"halves of real recordings, {options.model}", halved))
        document["halves"] = [asdict(a) for a in halved]
    if options.simulate:
        seeds = range(options.seed, options.seed + options.runs)
        items = [(scene, seed) for scene in options.scenario or SCENES for seed in seeds]
        runs = list(in_parallel(partial(of_seed, model=options.model), items, options.jobs, "simulated"))
        console.print(table(f"simulated, against the truth, {options.model}", runs))
        document["simulated"] = [asdict(a) for a in runs]
    if options.json:
        # a figure that nobody knows is null, not NaN
        options.json.write_text(json.dumps(document, indent=1).replace("NaN", "null") + "\n")
