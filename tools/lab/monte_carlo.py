"""Monte Carlo simulations: a table beside the paper's figures (sections 4.3 and 4.4) and for an MPU-6050 by hand.

python -m tools.lab monte_carlo --all --runs 60
python -m tools.lab monte_carlo --model accel --runs 1000
python -m tools.lab monte_carlo --model accel --runs 1000 --crlb
python -m tools.lab monte_carlo --scenario pose12 --model auto --runs 60 --json pose12.json
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.progress import track

import mpucal
from mpucal.calibration import MODELS
from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.calibration.fit import Fit
from mpucal.calibration.flat_segment import flat_statistics
from mpucal.calibration.model_selection import fit_accel
from mpucal.calibration.paper import fit_paper
from mpucal.data import Vector
from mpucal.errors import MpucalError
from tools.lab.study.metrics import sph_rms, tilt_errors_deg
from tools.lab.study.scenarios import GRAVITY_MPS2, MOTIONS, Simulated, hand_scenario, paper_scenario
from tools.lab.study.sensors import paper_sensor

from .tables import (
    SCENES,
    Run,
    Scene,
    accuracy_table,
    efficiency,
    efficiency_table,
    goals_table,
    summary,
)

# on data that conform to the model NIS is 3, and tens where the fit ended in a wrong optimum
NIS_WRONG = 10.0
FITS = {"accel": fit_accel, "paper": fit_paper}

Item = TypeVar("Item")
Result = TypeVar("Result")


def simulate(scene: Scene, seed: int, turn_s: float) -> Simulated:
    """The recording of a seed."""
    if scene.scenario == "paper":
        return paper_scenario(seed, turn_s=turn_s)
    return hand_scenario(seed, scene.scenario, tremble=scene.tremble, delay_s=scene.delay_ms * 1e-3)


def calibrate_one(seed: int, scene: Scene, model: str, turn_s: float) -> Run:
    """Simulate and calibrate a seed, and grade the result."""
    simulated = simulate(scene, seed, turn_s)
    truth = simulated.truth
    began = time.perf_counter()
    try:
        result = mpucal.calibrate(simulated.recording, model=model, gravity=GRAVITY_MPS2)
    except MpucalError as error:
        nothing = (np.nan,) * 3
        return Run(seed, model, str(error), 0, np.nan, time.perf_counter() - began, np.nan, 0, *(nothing,) * 3)
    seconds = time.perf_counter() - began
    D = np.array([np.eye(3), truth.D, result.D])
    b_a = np.array([np.zeros(3), truth.b_a, result.b_a])
    sph = tuple(sph_rms(truth, *sets) for sets in zip(D, b_a, strict=True))
    fit = result.fit
    nis = float(np.nan if fit["nis"] is None else fit["nis"])
    failure = None
    if not fit["converged"]:
        failure = "not converged"
    elif scene.scenario == "paper" and not nis < NIS_WRONG:
        failure = "wrong optimum (NIS)"
    elif not sph[2] < sph[0]:
        failure = "worse than no calibration"
    z = np.append(result.D - truth.D, result.b_a - truth.b_a) / np.append(result.D_std, result.b_a_std)
    known_K = int(np.isfinite(result.K_std[np.triu_indices(3)]).sum())
    roll, pitch = tilt_errors(simulated, D, b_a) if scene.scenario == "paper" else ((np.nan,) * 3,) * 2
    rms_z = float(np.sqrt(np.mean(z * z)))
    return Run(seed, fit["model"], failure, int(fit["iterations"]), nis, seconds, rms_z, known_K, sph, roll, pitch)


def tilt_errors(simulated: Simulated, D: Vector, b_a: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Roll and pitch errors [deg] of the orientations that the EKF finds with each parameter set (b, ...)."""
    recording = simulated.recording
    flat = flat_statistics(recording, recording.flat)
    x = np.concatenate([block.x for block in Ekf.after(flat, recording, GRAVITY_MPS2).run(D, b_a)])
    s = specific_force(x, GRAVITY_MPS2)
    errors = [tilt_errors_deg(simulated.specific_force[flat.last :], s[:, k]) for k in range(len(D))]
    return tuple(roll for roll, _ in errors), tuple(pitch for _, pitch in errors)


def fit_fixed(seed: int, model: str, sensor_seed: int, turn_s: float) -> tuple[Fit, Vector] | None:
    """Section 4.4: a fit to one sensor with a seed's noise, and its errors (12,); None if it failed."""
    sensor = paper_sensor(np.random.default_rng(sensor_seed))
    simulated = paper_scenario(seed, turn_s=turn_s, sensor=sensor)
    recording = simulated.recording
    fit = FITS[model](recording, flat_statistics(recording, recording.flat), GRAVITY_MPS2)
    if not (fit.converged and fit.nis < NIS_WRONG):
        return None
    error = np.concatenate([(fit.D - simulated.truth.D).ravel(), fit.b_a - simulated.truth.b_a])
    return fit, error


def in_parallel(
    function: Callable[[Item], Result], items: Sequence[Item], jobs: int, description: str
) -> Iterable[Result]:
    """function(item) of every item, in order, on `jobs` processes, with a progress bar."""
    # one thread a process: the arrays are small, and BLAS threads would only fight for the cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        results = pool.imap(function, items)
        yield from track(results, description, len(items), console=Console(stderr=True), transient=True)


def measured(scene: Scene, options: argparse.Namespace) -> dict[str, Any]:
    """The summary of a scene's runs, and the runs."""
    seeds = range(options.seed, options.seed + options.runs)
    one = partial(calibrate_one, scene=scene, model=options.model, turn_s=options.turn_s)
    runs = list(in_parallel(one, seeds, options.jobs, f"{scene.name}, {options.model}"))
    return {**summary(runs), "runs": [asdict(run) for run in runs]}


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenario", choices=("paper", *MOTIONS), default="paper")
    parser.add_argument("--all", action="store_true", help="every scenario, beside what is wanted of it")
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
    if options.crlb and (options.all or options.scenario != "paper" or options.model not in FITS):
        parser.error(f"--crlb goes with the paper's scenario and one of {', '.join(FITS)}")
    return options


def main() -> None:
    """Run, print and save."""
    options = arguments()
    began = time.perf_counter()
    # as wide as its content, whatever the terminal
    console = Console(width=140)
    about = f"model {options.model}, {options.runs} runs, seeds from {options.seed}"
    document: dict[str, Any]
    if options.crlb:
        one = partial(fit_fixed, model=options.model, sensor_seed=options.sensor_seed, turn_s=options.turn_s)
        seeds = range(options.seed, options.seed + options.runs)
        document = efficiency(list(in_parallel(one, seeds, options.jobs, f"one sensor, {options.model}")))
        console.print(efficiency_table(document, f"section 4.4, {about} of one sensor"))
    elif options.all:
        scenes = {scene.name: measured(scene, options) for scene in SCENES}
        document = {"scenarios": scenes}
        console.print(goals_table(scenes, about))
    else:
        scene = Scene(options.scenario, options.scenario, tremble=options.tremble, delay_ms=options.delay_ms)
        document = measured(scene, options)
        console.print(accuracy_table(document, f"{options.scenario}, {about}", options.scenario == "paper"))
    document["seconds"] = time.perf_counter() - began
    Console(stderr=True).print(f"{document['seconds']:.0f} s on {options.jobs} cores")
    if options.json:
        settings = {key: str(value) for key, value in vars(options).items()}
        # a figure that nobody knows is null, not NaN
        text = json.dumps({"settings": settings, **document}, indent=1).replace("NaN", "null")
        options.json.write_text(text + "\n")
