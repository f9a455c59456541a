"""Compare ways to calibrate on the same recordings: mpucal's, the paper's, six positions, an ellipsoid.

python -m tools.lab compare                                       simulated hands, against their truth
python -m tools.lab compare --without "the paper's algorithm"     which takes half a minute a recording
python -m tools.lab compare --scenes '12 poses' --seeds 20 --json compare.json
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated

import numpy as np

import mpucal
from mpucal.data import Recording
from mpucal.errors import MpucalError
from mpucal.simulated.sensor import SensorTruth

from .judge import sph_rms
from .monte_carlo import SCENES
from .rivals import Estimate, Rests, Unfit, aligned_ellipsoid, ellipsoid, six_positions
from .runner import Trial, each_seed, names_of
from .scenarios.recordings import GRAVITY_MPS2
from .table import Column, Row, count, over

RAW, AUTO = "uncalibrated", "mpucal auto"


def ours(recording: Recording, model: str) -> Estimate:
    """Calibrate by mpucal with a model."""
    result = mpucal.calibrate(recording, model=model, gravity=GRAVITY_MPS2)
    if not np.isfinite(result.D).all():
        raise Unfit(f"{result.verdict}: {', '.join(reason['code'] for reason in result.quality['reasons'])}")
    return Estimate(result.D, result.b_a)


def on_rests(recording: Recording, fit: Callable[[Rests, float], Estimate]) -> Estimate:
    """Calibrate by a method that uses only the rests."""
    return fit(Rests.of(recording), GRAVITY_MPS2)


METHODS: Mapping[str, Callable[[Recording], Estimate]] = {
    RAW: lambda recording: Estimate(np.eye(3), np.zeros(3)),
    AUTO: partial(ours, model="auto"),
    "mpucal accel": partial(ours, model="accel"),
    "the paper's algorithm": partial(ours, model="paper"),
    "six positions": partial(on_rests, fit=six_positions),
    "ellipsoid": partial(on_rests, fit=ellipsoid),
    "ellipsoid, turned to the gyro": partial(on_rests, fit=aligned_ellipsoid),
}


def grade(of: str, method: str, recording: Recording, truth: SensorTruth) -> Row:
    """Calibrate by a method, and judge the result: its error over all directions [m/s^2], or why there is none."""
    began = time.perf_counter()
    try:
        estimate = METHODS[method](recording)
    except (Unfit, MpucalError, np.linalg.LinAlgError) as error:
        return Row(of=of, method=method, why=str(error), worse=False)
    ms = np.nan if method == RAW else 1e3 * (time.perf_counter() - began)
    error, before = sph_rms(truth, estimate.D, estimate.b_a), sph_rms(truth, np.eye(3), np.zeros(3))
    return Row(of=of, method=method, why="", ms=ms, error=error, worse=error > before)


def graded(
    item: tuple[str, int], *, without: Annotated[list[str], names_of([*METHODS][2:]), "methods, with ; between"] = ()
) -> list[Row]:
    """Grade the methods on the recording of a scene and a seed."""
    simulated = SCENES[item[0]].simulate(item[1])
    methods = [method for method in METHODS if method not in without]
    return [grade(item[0], method, simulated.recording, simulated.truth) for method in methods]


COLUMNS: Mapping[str, Column] = {
    "error, m/s²": over("error"),
    "worst": over("error", max),
    "worse than none": count("worse"),
    "no result": count("why"),
    "ms": over("ms"),
    "why there is none": lambda of: "; ".join(dict.fromkeys(g.why for g in of if g.why)),
}
USUAL = ("12 poses", "six faces", "three turns", "continuous")


def scenarios(
    *, seeds: range, scenes: Annotated[list[str], names_of(SCENES), "patterns, with ; between"] = USUAL
) -> list[tuple[str, int]]:
    """Return each scene with each seed."""
    return each_seed(scenes, seeds)


main = Trial(__doc__, graded, scenarios, COLUMNS, by=("of", "method"), seeds="0:5")
