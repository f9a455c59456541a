"""Monte Carlo simulations: a table beside the paper's figures (sections 4.3 and 4.4) and for an MPU-6050 by hand.

python tools/monte_carlo.py --model accel --runs 1000
python tools/monte_carlo.py --model accel --runs 1000 --crlb
python tools/monte_carlo.py --scenario pose12 --model auto --runs 60 --json pose12.json
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import mpucal
from mpucal.calibration import MODELS
from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.calibration.estimate import fit_accel
from mpucal.calibration.model import B_A_NAMES, D_NAMES, Fit
from mpucal.calibration.paper import fit_paper
from mpucal.calibration.stationary import flat_statistics
from mpucal.data import Vector
from mpucal.errors import MpucalError
from mpucal.simulation.metrics import sph_rms, tilt_errors_deg
from mpucal.simulation.scenarios import GRAVITY_MPS2, MOTIONS, Simulated, hand_scenario, paper_scenario
from mpucal.simulation.sensors import paper_sensor

PAPER = {"uncalibrated": "8.3 (7.1) / 8.3 (6.9)", "calibrated": "0.32 (0.40) / 0.33 (0.43)", "iterations": "<= 6 (10)"}
# on data that conform to the model NIS is 3, and tens where the fit ended in a wrong optimum
NIS_WRONG = 10.0
FITS = {"accel": fit_accel, "paper": fit_paper}

Result = TypeVar("Result")


@dataclass(frozen=True)
class Run:
    """One simulated calibration; errors are (uncalibrated, true D and b_a, estimated)."""

    seed: int
    model: str
    failure: str | None
    iterations: int
    nis: float
    seconds: float
    sph_rms: tuple[float, ...]
    roll_deg: tuple[float, ...]
    pitch_deg: tuple[float, ...]


def simulate(scenario: str, seed: int, options: argparse.Namespace) -> Simulated:
    """The recording of a seed."""
    if scenario == "paper":
        return paper_scenario(seed, turn_s=options.turn_s)
    return hand_scenario(seed, scenario, tremble=options.tremble, delay_s=options.delay_ms * 1e-3)


def calibrate_one(seed: int, options: argparse.Namespace) -> Run:
    """Simulate and calibrate a seed, and grade the result."""
    simulated = simulate(options.scenario, seed, options)
    truth = simulated.truth
    began = time.perf_counter()
    try:
        result = mpucal.calibrate(simulated.recording, model=options.model, gravity=GRAVITY_MPS2)
    except MpucalError as error:
        nothing = (np.nan,) * 3
        return Run(seed, options.model, str(error), 0, np.nan, time.perf_counter() - began, *(nothing,) * 3)
    seconds = time.perf_counter() - began
    D = np.array([np.eye(3), truth.D, result.D])
    b_a = np.array([np.zeros(3), truth.b_a, result.b_a])
    sph = tuple(sph_rms(truth, *sets) for sets in zip(D, b_a, strict=True))
    fit = result.fit
    nis = float(np.nan if fit["nis"] is None else fit["nis"])
    failure = None
    if not fit["converged"]:
        failure = "not converged"
    elif options.scenario == "paper" and not nis < NIS_WRONG:
        failure = "wrong optimum (NIS)"
    elif not sph[2] < sph[0]:
        failure = "worse than no calibration"
    roll, pitch = tilt_errors(simulated, D, b_a) if options.scenario == "paper" else ((np.nan,) * 3,) * 2
    return Run(seed, fit["model"], failure, int(fit["iterations"] or 0), nis, seconds, sph, roll, pitch)


def tilt_errors(simulated: Simulated, D: Vector, b_a: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Roll and pitch errors [deg] of the orientations that the EKF finds with each parameter set (b, ...)."""
    recording = simulated.recording
    flat = flat_statistics(recording, recording.flat)
    x = np.concatenate([block.x for block in Ekf.after(flat, recording, GRAVITY_MPS2).run(D, b_a)])
    s = specific_force(x, GRAVITY_MPS2)
    errors = [tilt_errors_deg(simulated.specific_force[flat.last :], s[:, k]) for k in range(len(D))]
    return tuple(roll for roll, _ in errors), tuple(pitch for _, pitch in errors)


def fit_fixed(seed: int, options: argparse.Namespace) -> tuple[Fit, Vector] | None:
    """Section 4.4: a fit to one sensor with a seed's noise, and its errors (12,); None if it failed."""
    sensor = paper_sensor(np.random.default_rng(options.sensor_seed))
    simulated = paper_scenario(seed, turn_s=options.turn_s, sensor=sensor)
    recording = simulated.recording
    fit = FITS[options.model](recording, flat_statistics(recording, recording.flat), GRAVITY_MPS2)
    if not (fit.converged and fit.nis < NIS_WRONG):
        return None
    error = np.concatenate([(fit.D - simulated.truth.D).ravel(), fit.b_a - simulated.truth.b_a])
    return fit, error


def over_seeds(function: Callable[[int], Result], options: argparse.Namespace) -> Iterable[Result]:
    """function(seed) of every seed, on all cores, with a progress bar."""
    seeds = range(options.seed, options.seed + options.runs)
    # one thread a process: the arrays are small, and BLAS threads would only fight for the cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        yield from track(
            pool.imap(function, seeds),
            total=len(seeds),
            description=f"{options.scenario}, {options.model}",
            console=Console(stderr=True),
        )


def summary(runs: list[Run]) -> dict[str, Any]:
    """Means and standard deviations, over the successful runs and over all."""
    good = [run for run in runs if run.failure is None]
    failures: dict[str, int] = {}
    for run in runs:
        if run.failure:
            failures[run.failure] = failures.get(run.failure, 0) + 1
    rows = {
        "uncalibrated": (runs, 0),
        "true D, b_a": (runs, 1),
        "calibrated": (good, 2),
        "calibrated, all runs": (runs, 2),
    }
    return {
        "failures": failures,
        "failed_percent": 100.0 * (len(runs) - len(good)) / len(runs),
        "iterations": {
            "mean": spread([run.iterations for run in good])[0],
            "max": max((run.iterations for run in good), default=0),
        },
        "nis": [f([run.nis for run in good], default=None) for f in (min, max)],
        "seconds_each": spread([run.seconds for run in runs])[0],
        "models": {name: sum(run.model == name for run in runs) for name in sorted({run.model for run in runs})},
        "rows": {
            label: {key: spread([getattr(run, key)[k] for run in of]) for key in ("roll_deg", "pitch_deg", "sph_rms")}
            for label, (of, k) in rows.items()
        },
    }


def spread(values: list[float]) -> tuple[float, float] | tuple[None, None]:
    """Mean and standard deviation of those that are numbers."""
    numbers = np.array(values, float)
    numbers = numbers[np.isfinite(numbers)]
    return (float(numbers.mean()), float(numbers.std())) if len(numbers) else (None, None)


def accuracy_table(document: dict[str, Any], options: argparse.Namespace) -> Table:
    """The summary as a person reads it."""
    table = Table(title=f"{options.scenario}, model {options.model}, {options.runs} runs, seeds from {options.seed}")
    for column in ("", "roll deg (sd)", "pitch deg (sd)", "sph_rms m/s² (sd)", "the paper: roll / pitch"):
        table.add_column(column)
    for label, row in document["rows"].items():
        cells = [
            "" if row[key][0] is None else f"{row[key][0]:.4g} ({row[key][1]:.2g})"
            for key in ("roll_deg", "pitch_deg", "sph_rms")
        ]
        table.add_row(label, *cells, PAPER.get(label, "") if options.scenario == "paper" else "")
    iterations = document["iterations"]
    table.caption = (
        f"failed {document['failed_percent']:.1f} % {document['failures'] or ''}; "
        f"iterations {iterations['mean'] or 0:.2f} (max {iterations['max']}; the paper {PAPER['iterations']}); "
        f"{document['seconds_each']:.3f} s a calibration; models {document['models']}"
    )
    return table


def efficiency(fits: list[tuple[Fit, Vector] | None]) -> dict[str, Any]:
    """RMSE against the Cramér-Rao bound of the mean Fisher information, of the 12 parameters."""
    good = [pair for pair in fits if pair is not None]
    # of D and b_a alone: the other parameters' meaning may change with the run (tilts about an estimated axis)
    fisher = np.mean([np.linalg.inv(fit.covariance[:12, :12]) for fit, _ in good], axis=0)
    bound = np.sqrt(np.diag(np.linalg.inv(fisher)))
    rmse = np.sqrt(np.mean([error**2 for _, error in good], axis=0))
    names = (*D_NAMES, *B_A_NAMES)
    return {
        "failed": len(fits) - len(good),
        "parameters": {
            name: {"rmse": r, "sqrt_crlb": c, "ratio": r / c}
            for name, r, c in zip(names, rmse.tolist(), bound.tolist(), strict=True)
        },
    }


def efficiency_table(document: dict[str, Any], options: argparse.Namespace) -> Table:
    """The efficiency as a person reads it; the paper shows it as Fig. 4."""
    table = Table("parameter", "RMSE", "√CRLB", "RMSE / √CRLB", title=f"section 4.4, model {options.model}")
    for name, row in document["parameters"].items():
        table.add_row(name, f"{row['rmse']:.3g}", f"{row['sqrt_crlb']:.3g}", f"{row['ratio']:.3f}")
    table.caption = f"{options.runs} runs of one sensor, {document['failed']} failed"
    return table


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenario", choices=("paper", *MOTIONS), default="paper")
    parser.add_argument("--model", choices=MODELS, default="auto")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--turn-s", type=float, default=10.0, help="seconds a turn (paper)")
    parser.add_argument("--tremble", action="store_true", help="the hand trembles in its poses")
    parser.add_argument(
        "--delay-ms", type=float, default=0.0, help="of the accelerometer behind the gyroscope, by hand"
    )
    parser.add_argument("--crlb", action="store_true", help="section 4.4: one sensor, many noises")
    parser.add_argument("--sensor-seed", type=int, default=0, help="which sensor (--crlb)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    if options.crlb and (options.scenario != "paper" or options.model not in FITS):
        parser.error(f"--crlb goes with the paper's scenario and one of {', '.join(FITS)}")
    return options


def main() -> None:
    """Run, print and save."""
    options = arguments()
    began = time.perf_counter()
    document: dict[str, Any]
    if options.crlb:
        document = efficiency(list(over_seeds(partial(fit_fixed, options=options), options)))
        table = efficiency_table(document, options)
    else:
        runs = list(over_seeds(partial(calibrate_one, options=options), options))
        document = summary(runs)
        table = accuracy_table(document, options)
        document["runs"] = [asdict(run) for run in runs]
    document["seconds"] = time.perf_counter() - began
    # as wide as its content, whatever the terminal
    Console(width=120).print(table)
    Console(stderr=True).print(f"{document['seconds']:.0f} s on {options.jobs} cores")
    if options.json:
        settings = {key: str(value) for key, value in vars(options).items()}
        # a figure that nobody knows is null, not NaN
        text = json.dumps({"settings": settings, **document}, indent=1).replace("NaN", "null")
        options.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
