"""Times and memory of what mpucal does: python -m tools.bench speed.

The kernel is compared with its NumPy twins on the same data in the same run, so that their ratio means the same on
every machine. Times are the processor's, so that what else runs counts little. Nothing here passes or fails.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated, Any

import numpy as np

from mpucal.allan import noise_of
from mpucal.calibration import calibrate
from mpucal.calibration.fit import Fit
from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.likelihood import evaluate, value
from mpucal.calibration.model_selection import fit_model
from mpucal.calibration.parameters import ACCEL, HAND, IMU
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.theta import Theta
from mpucal.data import Recording
from mpucal.kernel import _kernel
from mpucal.rests.flat import Flat
from tools.lab.reference import evaluate_hand_reference, evaluate_reference
from tools.lab.scenarios.recordings import hand_scenario, known_flat, paper_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2
from tools.lab.table import plain_table, show

from .timing import median_s, peak_bytes

FLAT_S, TURNS = 10.0, 3
# long enough that the start of a loop does not count, and what the NumPy twins do in a second
KERNEL_STEPS, TWIN_STEPS = 10_000, 300
# runs of a millisecond or two: many, so that a burst of other work does not affect the median
MORE_OF_A_KERNEL = 15
RESTING = 4_000_000
GROWTH = (1_000, 10_000, 100_000, 1_000_000)


def turned(seconds: float, rate_hz: float, turns: int = TURNS) -> Recording:
    """Simulate ten seconds flat, then turns about the axes, with a sensor of the paper's simulation."""
    return paper_scenario(0, rate_hz=rate_hz, turn_s=(seconds - FLAT_S) / turns, turns=turns).recording


def estimated(recording: Recording, flat: Flat, model: str) -> Fit:
    """Return the fit of the model that is chosen, with honest uncertainties."""
    return fit_model(recording, flat, GRAVITY_MPS2, model).honest()


def calibrations(runs: int) -> list[dict[str, Any]]:
    """Time whole calibrations with their verdicts, and the estimation alone."""
    by_hand = hand_scenario(0, "pose12").recording
    rows = []
    for motion, recording, model in (
        ("three turns", turned(60.0, 200.0), "accel"),
        ("three turns", turned(60.0, 200.0), "auto"),
        ("three turns", turned(160.0, 100.0), "accel"),
        ("three turns", turned(160.0, 100.0), "auto"),
        ("12 poses by hand", by_hand, "auto"),
        ("59 turns", turned(600.0, 1000.0, 59), "accel"),
    ):
        found = calibrate(recording, model, GRAVITY_MPS2)
        estimation_s = median_s(partial(estimated, recording, known_flat(recording), model), runs)
        whole_s = median_s(partial(calibrate, recording, model, GRAVITY_MPS2), runs)
        length_s = float(recording.t[-1] - recording.t[0])
        rows.append(
            {
                "recording": f"{motion}, {length_s:.0f} s at {recording.rate_hz:.0f} Hz",
                "model": model if found.fit["model"] == model else f"{model}: {found.fit['model']}",
                "iterations": found.fit["iterations"],
                "estimation ms": 1e3 * estimation_s,
                "whole ms": 1e3 * whole_s,
                "whole / estimation": whole_s / estimation_s,
                "µs a sample": 1e6 * whole_s / len(recording),
            }
        )
    return rows


def problem_of(recording: Recording) -> tuple[Problem, Theta]:
    """Return the problem of the filters, and the initial estimate."""
    flat = known_flat(recording)
    problem = Problem(Series.after(recording, flat), flat, GRAVITY_MPS2)
    return problem, initialise(problem, flat.b_omega)


def as_hand(problem: Problem) -> Problem:
    """Return the problem for the hand's filter, with all optional inputs."""
    series = problem.series
    n = len(series)
    alpha = np.gradient(series.omega, axis=0) / series.dt[:, None]
    moved = replace(series, rate=series.omega, alpha=alpha, jerk=np.full(n, 1.0), r_extra=np.zeros(n))
    return replace(problem, series=moved, huber=3.0)


def cut(problem: Problem, steps: int) -> Problem:
    """Return the problem of the first steps."""
    arrays: dict[str, Any] = {name: None if x is None else x[:steps] for name, x in vars(problem.series).items()}
    return replace(problem, series=replace(problem.series, **arrays))


def kernel(runs: int) -> list[dict[str, Any]]:
    """Time one step of V, and of V with gradient and Fisher matrix, beside the NumPy twin."""
    problem, theta = problem_of(turned(60.0, 200.0))
    runs *= MORE_OF_A_KERNEL
    rows = []
    for parameters, of in ((ACCEL, problem), (IMU, problem), (HAND, as_hand(problem))):
        long, short = cut(of, KERNEL_STEPS), cut(of, TWIN_STEPS)
        hand = parameters == HAND
        alone = partial(value, long, theta) if hand else partial(evaluate, long, theta, 0)
        reference, more = (evaluate_hand_reference, ()) if hand else (evaluate_reference, (parameters,))
        ns_value = 1e9 * median_s(alone, runs) / KERNEL_STEPS
        ns_all = 1e9 * median_s(partial(evaluate, long, theta, parameters), runs) / KERNEL_STEPS
        ns_twin = 1e9 * median_s(partial(reference, short, theta, *more), 1) / TWIN_STEPS
        rows.append(
            {
                "parameters": parameters,
                "filter": "hand" if hand else "exact",
                "V [ns]": ns_value,
                "V, gradient, Fisher [ns]": ns_all,
                "the same in NumPy [ns]": ns_twin,
                "NumPy / kernel": ns_twin / ns_all,
            }
        )
    return rows


def growth(runs: int) -> list[dict[str, Any]]:
    """Time the fit by `accel` of a minute at one rate after the other, and find the most memory it needed."""
    rows = []
    for n in GROWTH:
        recording = turned(60.0, n / 60.0)
        s = median_s(partial(fit_model, recording, known_flat(recording), GRAVITY_MPS2, "accel"), runs)
        whole = peak_bytes(partial(calibrate, recording, "accel", GRAVITY_MPS2))
        rows.append(
            {
                "samples": len(recording),
                "ms": 1e3 * s,
                "µs a sample": 1e6 * s / len(recording),
                "peak bytes a sample, verdict included": whole / len(recording),
            }
        )
    return rows


def noise(runs: int) -> list[dict[str, Any]]:
    """Time the statistics of a long rest, without its reading."""
    steps = np.random.default_rng(0).standard_normal((6, RESTING))
    rest = Recording.from_arrays(np.arange(RESTING) / 200.0, steps[:3].T, steps[3:].T)
    return [{"samples": RESTING, "million samples/s": 1e-6 * RESTING / median_s(lambda: noise_of(rest), runs)}]


def main(*, runs: Annotated[int, "of which the median counts"] = 7) -> None:
    """Measure and print."""
    measured = {
        "mpucal.calibrate": calibrations(runs),
        f"one step of the filter ({_kernel.instruction_set()})": kernel(runs),
        "the fit of `accel`, by the number of samples": growth(min(runs, 3)),
        "mpucal.noise": noise(min(runs, 3)),
    }
    show(*(plain_table(rows, title) for title, rows in measured.items()))
