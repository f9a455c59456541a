"""Compare ways to calibrate on the same recordings: mpucal's, the paper's, six positions, an ellipsoid, imucal.

python -m tools.lab compare                                       simulated hands, against their truth
python -m tools.lab compare recordings/*.npz                      real recordings, by their rests and magnitudes
python -m tools.lab compare --without "the paper's algorithm"     which takes half a minute a recording
python -m tools.lab compare --scenario pose12 --runs 20 --json compare.json
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Vector
from mpucal.errors import MpucalError
from mpucal.simulated.sensor import SensorTruth
from tools.lab.study.metrics import sph_rms
from tools.lab.study.scenarios import GRAVITY_MPS2, MOTIONS, hand_scenario

from .monte_carlo import in_parallel
from .rivals import Estimate, Rests, Unfit, aligned_ellipsoid, ellipsoid, imucal, six_positions
from .tables import number

RAW, AUTO = "uncalibrated", "mpucal auto"
# section 4.1, Galaxy S5, ||g|| = 9.82: mean and sd of the magnitude after calibration; nothing is printed of before
PAPER_4_1 = {"the paper, six poses": (9.81, 0.23), "the paper, continuous": (9.80, 0.30)}


@dataclass(frozen=True)
class Grade:
    """What a method made of a recording; NaN where nobody knows.

    Attributes
    ----------
    why : the sentence that says why there is no result; None where there is one. note : what else to know of it.
    sph_rms : m/s^2, against the truth, over all directions.
    median, mean, std : m/s^2, of the magnitude of all samples.
    rest_rms : m/s^2, of the rests' magnitudes less gravity. miss_median, miss_max : deg, by which gravity, carried from
        rest to rest by the gyroscope, misses what the accelerometer says there.
    """

    method: str
    why: str | None = None
    note: str = ""
    seconds: float = np.nan
    sph_rms: float = np.nan
    median: float = np.nan
    mean: float = np.nan
    std: float = np.nan
    rest_rms: float = np.nan
    miss_median: float = np.nan
    miss_max: float = np.nan


def raw(recording: Recording, gravity: float) -> Estimate:
    """No calibration at all."""
    return Estimate(np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))


def ours(recording: Recording, gravity: float, model: str) -> Estimate:
    """mpucal.calibrate with a model."""
    result = mpucal.calibrate(recording, model=model, gravity=gravity)
    codes = ", ".join(reason["code"] for reason in result.quality["reasons"])
    if not np.isfinite(result.D).all():
        raise Unfit(f"{result.verdict}: {codes}")
    chosen = f"{result.fit['model']}, " if model == "auto" else ""
    return Estimate(
        result.D, result.b_a, result.K, result.b_omega, f"{chosen}{result.verdict}{f' ({codes})' if codes else ''}"
    )


def on_rests(recording: Recording, gravity: float, fit: Callable[[Rests, float], Estimate]) -> Estimate:
    """A method that sees the rests alone."""
    return fit(Rests.of(recording), gravity)


METHODS: Mapping[str, Callable[[Recording, float], Estimate]] = {
    RAW: raw,
    AUTO: partial(ours, model="auto"),
    "mpucal accel": partial(ours, model="accel"),
    "the paper's algorithm": partial(ours, model="paper"),
    "six positions": partial(on_rests, fit=six_positions),
    "ellipsoid": partial(on_rests, fit=ellipsoid),
    "ellipsoid, turned to the gyro": partial(on_rests, fit=aligned_ellipsoid),
    "imucal": partial(on_rests, fit=imucal),
}


def grade(method: str, recording: Recording, gravity: float, truth: SensorTruth | None) -> Grade:
    """Calibrate by a method, and judge what it gives."""
    began = time.perf_counter()
    try:
        estimate = METHODS[method](recording, gravity)
    except (Unfit, MpucalError, np.linalg.LinAlgError) as error:
        return Grade(method, why=str(error))
    seconds = np.nan if method == RAW else time.perf_counter() - began
    D, b_a = estimate.D, estimate.b_a
    a = np.linalg.norm((recording.acc - b_a) @ np.linalg.inv(D).T, axis=1)
    return Grade(
        method,
        note=estimate.note,
        seconds=seconds,
        sph_rms=np.nan if truth is None else sph_rms(truth, D, b_a),
        median=float(np.median(a)),
        mean=float(a.mean()),
        std=float(a.std()),
        **_of_rests(recording, estimate, gravity),
    )


def _of_rests(recording: Recording, estimate: Estimate, gravity: float) -> dict[str, float]:
    try:
        rests = Rests.of(recording).trimmed()
    except Unfit:
        return {}
    if len(rests.runs) == 0:
        return {}
    s = (rests.y - estimate.b_a) @ np.linalg.inv(estimate.D).T
    known = {"rest_rms": float(np.sqrt(np.mean((np.linalg.norm(s, axis=1) - gravity) ** 2)))}
    misses = np.degrees(rests.misses_rad(estimate.D, estimate.b_a, estimate.K))
    if len(misses):
        known |= {"miss_median": float(np.median(misses)), "miss_max": float(misses.max())}
    return known


def of_simulated(seed: int, scenario: str, tremble: bool, methods: tuple[str, ...]) -> list[Grade]:
    """The methods on a simulated recording."""
    simulated = hand_scenario(seed, scenario, tremble=tremble)
    return [grade(method, simulated.recording, GRAVITY_MPS2, simulated.truth) for method in methods]


def of_file(path: Path, gravity: float, methods: tuple[str, ...]) -> list[Grade]:
    """The methods on a recorded file."""
    recording = mpucal.load(path)
    return [grade(method, recording, gravity, None) for method in methods]


def simulated_table(scenario: str, runs: list[list[Grade]]) -> Table:
    """Errors of the methods over the seeds of a scenario."""
    table = Table("method", title=f"{scenario}, {len(runs)} seeds: sph_rms m/s²")
    for column in ("mean", "worst", "worse than none", "no result", "ms"):
        table.add_column(column, justify="right")
    table.add_column("why there is none")
    without = [run[0].sph_rms for run in runs]
    for of in zip(*runs, strict=True):
        method = of[0].method
        failed = [g.why for g in of if g.why is not None]
        errors = np.array([g.sph_rms for g in of])
        known = errors[np.isfinite(errors)]
        table.add_row(
            method,
            number(known.mean() if len(known) else None),
            number(known.max() if len(known) else None),
            "" if method == RAW or len(known) == 0 else str(int(np.sum(errors > without))),
            str(len(failed) or ""),
            _milliseconds([g.seconds for g in of]),
            max(set(failed), key=failed.count) if failed else "",
        )
    return table


def recorded_table(name: str, of: list[Grade]) -> Table:
    """The methods on a real recording, whose truth nobody knows."""
    table = Table("method", title=name)
    for column in ("|a| median", "mean", "sd", "rests |a| - g", "gyro misses, deg (worst)", "ms"):
        table.add_column(column, justify="right")
    table.add_column("note")
    for g in of:
        cells = [f"{x:.3f}" if np.isfinite(x) else "-" for x in (g.median, g.mean, g.std)]
        rest = f"{g.rest_rms:.4f}" if np.isfinite(g.rest_rms) else "-"
        miss = f"{g.miss_median:.2f} ({g.miss_max:.2f})" if np.isfinite(g.miss_median) else "-"
        table.add_row(g.method, *cells, rest, miss, _milliseconds([g.seconds]), g.why or g.note)
    return table


def magnitudes_table(recordings: Mapping[str, list[Grade]], gravity: float) -> Table:
    """Section 4.1: the magnitude of all samples before and after, the paper's below."""
    table = Table("recording", title=f"section 4.1: |a| before -> after, m/s², gravity {gravity:g}")
    for column in ("median", "mean", "sd"):
        table.add_column(column, justify="center")
    for name, of in recordings.items():
        before, after = ({g.method: g for g in of}[method] for method in (RAW, AUTO))
        pairs = [(getattr(before, key), getattr(after, key)) for key in ("median", "mean", "std")]
        table.add_row(name, *(f"{a:.3f} -> {b:.3f}" if np.isfinite(b) else f"{a:.3f} -> -" for a, b in pairs))
    table.add_section()
    for name, (mean, sd) in PAPER_4_1.items():
        table.add_row(f"{name} (gravity 9.82)", "", f"-> {mean:.2f}", f"-> {sd:.2f}")
    return table


def _milliseconds(seconds: Iterable[float]) -> str:
    known: Vector = np.array([s for s in seconds if np.isfinite(s)])
    return f"{1e3 * known.mean():.0f}" if len(known) else ""


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="*", type=Path, help="files that mpucal reads; none: simulated hands")
    parser.add_argument("--scenario", action="append", choices=MOTIONS, help="simulated; may be given more than once")
    parser.add_argument("--runs", type=int, default=5, help="seeds of each scenario")
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--tremble", action="store_true", help="the hand trembles in its poses")
    parser.add_argument("--without", action="append", choices=[*METHODS][2:], default=[], help="leave a method out")
    parser.add_argument("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2, of the recordings")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    options.methods = tuple(method for method in METHODS if method not in options.without)
    if not options.scenario and not options.recordings:
        options.scenario = ["pose12", "pose6", "turns", "continuous"]
    return options


def main() -> None:
    """Compare, print and save."""
    options = arguments()
    console = Console(width=150)
    document: dict[str, Any] = {"simulated": {}, "recorded": {}}
    seeds = range(options.seed, options.seed + options.runs)
    for scenario in options.scenario or ():
        one = partial(of_simulated, scenario=scenario, tremble=options.tremble, methods=options.methods)
        runs = list(in_parallel(one, seeds, options.jobs, scenario))
        console.print(simulated_table(scenario, runs))
        document["simulated"][scenario] = [[asdict(g) for g in run] for run in runs]
    if options.recordings:
        one = partial(of_file, gravity=options.gravity, methods=options.methods)
        done = in_parallel(one, options.recordings, options.jobs, "recordings")
        recorded = dict(zip((path.stem for path in options.recordings), done, strict=True))
        for name, of in recorded.items():
            console.print(recorded_table(name, of))
        console.print(magnitudes_table(recorded, options.gravity))
        document["recorded"] = {name: [asdict(g) for g in of] for name, of in recorded.items()}
    if options.json:
        # a figure that nobody knows is null, not NaN
        options.json.write_text(json.dumps(document, indent=1).replace("NaN", "null") + "\n")
