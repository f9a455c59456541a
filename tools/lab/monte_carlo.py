"""Monte Carlo simulations: an MPU-6050 by hand and the paper's sensors (sections 4.3 and 4.4), and required errors.

python -m tools.lab monte_carlo --seeds 60
python -m tools.lab monte_carlo --scenes '12 poses;continuous' --model hand --seeds 60 --json poses.json
python -m tools.lab monte_carlo --scenes paper --seeds 1000             beside the paper's figures
python -m tools.lab monte_carlo --methods '*' --seeds 5                 beside other methods: the paper's takes long
python -m tools.lab monte_carlo --crlb --model accel --seeds 1000       one sensor, many noises
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
from rich.table import Table

import mpucal
from mpucal.calibration.fit import Fit
from mpucal.calibration.model_selection import fit_in_place
from mpucal.calibration.paper import fit_paper
from mpucal.calibration.parameters import ACCEL, B_A_NAMES, D_NAMES
from mpucal.data import Recording
from mpucal.errors import MpucalError
from mpucal.rests.flat import Flat
from mpucal.result.calibration import REFUSED
from mpucal.result.keys import Model

from .judge import followed, judged, judgement, sph_rms, tilts_deg
from .rivals import Estimate, Rests, Unfit, aligned_ellipsoid, ellipsoid, six_positions
from .runner import Trial, names_of
from .scenarios.family import Simulated
from .scenarios.recordings import hand_scenario, known_flat, paper_scenario
from .scenarios.sensors import GRAVITY_MPS2, hand_sensor, paper_sensor
from .table import Column, Row, cell, frequencies, grouped, known, over, plain_table, show, table

# NIS is 3 for data that conform to the model, and tens if the fit ended in a wrong optimum
NIS_WRONG = 10.0
FITS: dict[str, Callable[[Recording, Flat, float], Fit]] = {"accel": partial(fit_in_place, ACCEL), "paper": fit_paper}
PRINTED = "the paper's algorithm"
TILTS = ("uncalibrated", "true D, b_a", "calibrated")
# required mean errors, and means (standard deviations) of the paper before and after calibration [deg]
PAPER = {"roll": ("0.345", "8.3 (7.1)", "0.32 (0.40)"), "pitch": ("0.265", "8.3 (6.9)", "0.33 (0.43)")}


class Scene(NamedTuple):
    """Simulation by a seed, and the required mean error [m/s^2]; None: not set."""

    simulate: Callable[[int], Simulated]
    wanted: float | None = None


def gyro_off(seed: int) -> Simulated:
    """Simulate the paper's scenario with a gyroscope that has scale factor errors and misalignments."""
    of_sensor, of_gyro = np.random.default_rng(seed).spawn(2)
    return paper_scenario(seed, sensor=paper_sensor(of_sensor)._replace(K=hand_sensor(of_gyro).K))


SCENES = {
    "paper": Scene(paper_scenario),
    "paper, gyro off": Scene(gyro_off),
    "12 poses": Scene(partial(hand_scenario, motion="pose12"), 0.004),
    "12 poses, trembling": Scene(partial(hand_scenario, motion="pose12", tremble=True), 0.007),
    "9 poses": Scene(partial(hand_scenario, motion="pose9")),
    "7 poses": Scene(partial(hand_scenario, motion="pose7")),
    "six faces": Scene(partial(hand_scenario, motion="pose6"), 0.21),
    "three turns": Scene(partial(hand_scenario, motion="turns"), 0.12),
    "continuous": Scene(partial(hand_scenario, motion="continuous"), 0.037),
    "continuous, 1 ms late": Scene(partial(hand_scenario, motion="continuous", delay_s=1e-3), 0.037),
    "wobbling by 30 %": Scene(partial(hand_scenario, motion="wobble30"), 0.10),
    "wobbling by 100 %": Scene(partial(hand_scenario, motion="wobble100"), 0.135),
    "calm, 3 jerks/s": Scene(partial(hand_scenario, motion="calm jerks"), 0.0022),
}


METHODS: dict[str, Callable[[Rests, float], Estimate] | None] = {
    "mpucal": None,
    PRINTED: None,
    "six positions": six_positions,
    "ellipsoid": ellipsoid,
    "ellipsoid, turned to the gyro": aligned_ellipsoid,
}


def of_seed(item: tuple[str, int, str], model: Model) -> Row:
    """Simulate a scene and a seed, calibrate by a method, and judge the result.

    In the row, `before` is the error without a calibration [m/s^2], `failure` why it does not count, `known_K` the
    number of K's six elements with a standard uncertainty, and the tilts are errors with each of TILTS.
    """
    scene, seed, method = item
    simulated = SCENES[scene].simulate(seed)
    recording, truth, of_rests = simulated.recording, simulated.truth, METHODS[method]
    same: dict[str, Any] = {
        "scene": scene,
        "seed": seed,
        "method": method,
        "before": sph_rms(truth, np.eye(3), np.zeros(3)),
    }
    began = time.perf_counter()
    try:
        if of_rests:
            found = of_rests(Rests.of(recording), GRAVITY_MPS2)
            row = judgement(error=sph_rms(truth, found.D, found.b_a), **same, model=method, failure=None)
        else:
            model = "paper" if method == PRINTED else model
            result = mpucal.calibrate(recording, model=model, gravity=GRAVITY_MPS2)
            same |= {"model": result.fit["model"], "failure": None}
            row = judged(result, (truth.D, truth.b_a), gravity=truth.gravity, **same)
    except (MpucalError, Unfit) as error:
        return judgement(REFUSED, **same, model=model, failure=str(error))
    row.ms, of_paper = 1e3 * (time.perf_counter() - began), scene.startswith("paper")
    if not row.error < row.before:
        row.failure = "worse than no calibration"
    if not of_rests:
        row.known_K = int(np.isfinite(result.K_std[np.triu_indices(3)]).sum())
        if not result.fit["converged"]:
            row.failure = "not converged"
        elif of_paper and not (result.fit["nis"] or np.inf) < NIS_WRONG:
            row.failure = "wrong optimum (NIS)"
        if of_paper:
            row.roll_deg, row.pitch_deg = tilts(simulated, result)
    return row


def tilts(simulated: Simulated, result: mpucal.Calibration) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return roll and pitch errors [deg] of the orientations that the paper's filter finds with each of TILTS."""
    recording, truth = simulated.recording, simulated.truth
    D, b_a = np.array([np.eye(3), truth.D, result.D]), np.array([np.zeros(3), truth.b_a, result.b_a])
    flat = known_flat(recording)
    return tilts_deg(simulated.specific_force[flat.last :], followed(recording, flat, D, b_a, GRAVITY_MPS2))


def successful(runs: Sequence[Row]) -> list[Row]:
    """Return the runs without failure."""
    return [run for run in runs if run.failure is None]


def wanted_error(runs: Sequence[Row]) -> float | None:
    """Return the mean error that mpucal is to have in a scene [m/s^2]; None if none is set."""
    return SCENES[runs[0].scene].wanted if runs[0].method == "mpucal" else None


def met(runs: Sequence[Row]) -> bool | None:
    """Return True if all runs of a scene succeeded with the required mean error; None if none is set."""
    if (wanted := wanted_error(runs)) is None:
        return None
    return len(successful(runs)) == len(runs) and float(np.mean(known(runs, "error"))) <= wanted


def of_successful(name: str, make: Column = np.mean) -> Column:
    """Return a column over an attribute of the runs without failure."""
    return lambda runs: over(name, make)(successful(runs))


Z_COLUMNS: dict[str, Column] = {
    "rms z, median": of_successful("rms_z", np.median),
    "worst": of_successful("rms_z", max),
    "largest |z|": of_successful("z", lambda z: np.abs(z).max()),
}
COLUMNS: dict[str, Column] = {
    "uncalibrated": over("before"),
    "error, m/s²": of_successful("error"),
    "worst error": of_successful("error", max),
    "wanted": wanted_error,
    "met": lambda runs: {None: "", True: "yes", False: "[red]no[/red]"}[met(runs)],
    **Z_COLUMNS,
    "K known": of_successful("known_K"),
    "ms": over("ms", lambda ms: round(np.mean(ms))),
    "models, failures": lambda runs: frequencies(run.failure or run.model for run in runs),
}


def tilt_table(runs: Sequence[Row]) -> Table:
    """Return section 4.3: means (standard deviations) of the errors of roll and pitch, beside the paper's."""
    lines = Table("deg", *TILTS, "wanted", "the paper, before", "after", title="the paper's scenario")
    for name, beside in PAPER.items():
        errors = np.array([getattr(run, f"{name}_deg") for run in successful(runs)])
        means = [f"{cell(float(mean))} ({sd:.2g})" for mean, sd in zip(errors.mean(0), errors.std(0), strict=True)]
        lines.add_row(name, *means, *beside)
    return lines


def fit_fixed(seed: int, model: str) -> Row | None:
    """Fit one sensor with a seed's noise, as in section 4.4; None if it failed."""
    simulated = paper_scenario(seed, sensor=paper_sensor(np.random.default_rng(0)))
    recording = simulated.recording
    fit = FITS[model](recording, known_flat(recording), GRAVITY_MPS2)
    if not (fit.converged and fit.nis < NIS_WRONG):
        return None
    errors = np.concatenate([(fit.D - simulated.truth.D).ravel(), fit.b_a - simulated.truth.b_a])
    # the other parameters' meaning may change with the run (tilts about an estimated axis)
    return Row(covariance=fit.covariance[:12, :12].tolist(), errors=errors.tolist())


def efficiency(fits: Sequence[Row]) -> list[dict[str, Any]]:
    """Return a row a parameter of D and b_a: RMSE against the Cramér-Rao bound of the mean Fisher information."""
    fisher = np.mean([np.linalg.inv(fit.covariance) for fit in fits], axis=0)
    bound = np.sqrt(np.diag(np.linalg.inv(fisher)))
    rmse = np.sqrt(np.mean([np.square(fit.errors) for fit in fits], axis=0))
    rows = zip((*D_NAMES, *B_A_NAMES), rmse.tolist(), bound.tolist(), (rmse / bound).tolist(), strict=True)
    return [dict(zip(("", "RMSE", "√CRLB", "RMSE / √CRLB"), row, strict=True)) for row in rows]


def tried(item: int | tuple[str, int, str], *, model: Model = "auto") -> Row | None:
    """Fit one sensor with a seed's noise, or calibrate a scene and a seed."""
    return fit_fixed(item, model) if isinstance(item, int) else of_seed(item, model)


def scenarios(
    *,
    seeds: range,
    scenes: Annotated[Sequence[str], names_of(SCENES), "patterns, with ; between"] = tuple(SCENES),
    methods: Annotated[Sequence[str], names_of(METHODS), "patterns, with ; between"] = ("mpucal",),
    crlb: Annotated[bool, f"section 4.4: one sensor, many noises; --model {' or '.join(FITS)}"] = False,
) -> Sequence[int | tuple[str, int, str]]:
    """Return the seeds of one sensor's noises, or the seeds of each scene."""
    return seeds if crlb else list(product(scenes, seeds, methods))


def report(found: list[Any], seeds: range, model: str, crlb: bool) -> None:
    """Print the efficiency of the fits, or a line a scene."""
    about = f"model {model}, {len(seeds)} seeds from {seeds[0]}"
    if crlb:
        failed = len(seeds) - len(found)
        show(plain_table(efficiency(found), f"section 4.4, {about}, of one sensor; {failed} failed"))
        return
    show(table(grouped(found, "scene", "method"), COLUMNS, about))
    show(table(grouped([run for run in successful(found) if run.z], "model"), Z_COLUMNS, "claims by model"))
    if of_paper := [run for run in found if run.scene == "paper" and run.method == "mpucal"]:
        show(tilt_table(of_paper))


main = Trial(__doc__, tried, scenarios, report=report, seeds="0:60")
