"""Compare ways to calibrate on the same recordings: mpucal's, the paper's, six positions, an ellipsoid, imucal.

python -m tools.lab compare                                       simulated hands, against their truth
python -m tools.lab compare recordings/*.npz                      real recordings, by their rests and magnitudes
python -m tools.lab compare --without "the paper's algorithm"     which takes half a minute a recording
python -m tools.lab compare --scenes '12 poses' --seeds 20 --json compare.json
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.errors import MpucalError
from mpucal.simulated.sensor import SensorTruth

from .judge import sph_rms
from .monte_carlo import SCENES
from .rivals import Estimate, Rests, Unfit, aligned_ellipsoid, ellipsoid, imucal, six_positions
from .runner import Asked, Program, names_of, option
from .scenarios.recordings import GRAVITY_MPS2
from .table import Column, count, grouped, over, show, table

RAW, AUTO = "uncalibrated", "mpucal auto"


@dataclass(frozen=True)
class Grade:
    """Result of a method on a recording; NaN: not known.

    Attributes
    ----------
    of : the scene, or the recording. why : why there is no result, or empty. note : remark on the result.
    error, before : m/s^2, against the truth, over all directions, and without a calibration. ms : the time it took.
    median, mean, std : m/s^2, of the magnitude of all samples.
    rest_rms : m/s^2, of the rests' magnitudes less gravity. miss_median, miss_max : deg, by which gravity, carried from
        rest to rest by the gyroscope, misses what the accelerometer says there.
    """

    of: str
    method: str
    why: str = ""
    note: str = ""
    ms: float = np.nan
    error: float = np.nan
    before: float = np.nan
    median: float = np.nan
    mean: float = np.nan
    std: float = np.nan
    rest_rms: float = np.nan
    miss_median: float = np.nan
    miss_max: float = np.nan

    @property
    def worse(self) -> bool:
        """Return True if it is worse than no calibration."""
        return self.error > self.before


# section 4.1, Galaxy S5: mean and sd of the magnitude after calibration; nothing is printed of before
PAPER_4_1 = (
    Grade("the paper, gravity 9.82", "six poses", mean=9.81, std=0.23),
    Grade("the paper, gravity 9.82", "continuous", mean=9.80, std=0.30),
)


def ours(recording: Recording, gravity: float, model: str) -> Estimate:
    """Calibrate by mpucal with a model."""
    result = mpucal.calibrate(recording, model=model, gravity=gravity)
    codes = ", ".join(reason["code"] for reason in result.quality["reasons"])
    if not np.isfinite(result.D).all():
        raise Unfit(f"{result.verdict}: {codes}")
    chosen = f"{result.fit['model']}, " if model == "auto" else ""
    note = f"{chosen}{result.verdict}{f' ({codes})' if codes else ''}"
    return Estimate(result.D, result.b_a, result.K, result.b_omega, note)


def on_rests(recording: Recording, gravity: float, fit: Callable[[Rests, float], Estimate]) -> Estimate:
    """Calibrate by a method that uses only the rests."""
    return fit(Rests.of(recording), gravity)


METHODS: Mapping[str, Callable[[Recording, float], Estimate]] = {
    RAW: lambda recording, gravity: Estimate(np.eye(3), np.zeros(3), np.eye(3), np.zeros(3)),
    AUTO: partial(ours, model="auto"),
    "mpucal accel": partial(ours, model="accel"),
    "the paper's algorithm": partial(ours, model="paper"),
    "six positions": partial(on_rests, fit=six_positions),
    "ellipsoid": partial(on_rests, fit=ellipsoid),
    "ellipsoid, turned to the gyro": partial(on_rests, fit=aligned_ellipsoid),
    "imucal": partial(on_rests, fit=imucal),
}


def grade(of: str, method: str, recording: Recording, gravity: float, truth: SensorTruth | None = None) -> Grade:
    """Calibrate by a method, and judge the result."""
    began = time.perf_counter()
    try:
        estimate = METHODS[method](recording, gravity)
    except (Unfit, MpucalError, np.linalg.LinAlgError) as error:
        return Grade(of, method, why=str(error))
    ms = np.nan if method == RAW else 1e3 * (time.perf_counter() - began)
    a = np.linalg.norm((recording.acc - estimate.b_a) @ np.linalg.inv(estimate.D).T, axis=1)
    return Grade(
        of,
        method,
        note=estimate.note,
        ms=ms,
        error=np.nan if truth is None else sph_rms(truth, estimate.D, estimate.b_a),
        before=np.nan if truth is None else sph_rms(truth, np.eye(3), np.zeros(3)),
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
    found = {"rest_rms": float(np.sqrt(np.mean((np.linalg.norm(s, axis=1) - gravity) ** 2)))}
    misses = np.degrees(rests.misses_rad(estimate.D, estimate.b_a, estimate.K))
    if len(misses):
        found |= {"miss_median": float(np.median(misses)), "miss_max": float(misses.max())}
    return found


def graded(item: Path | tuple[str, int], without: Sequence[str], gravity: float) -> list[Grade]:
    """Grade the methods on a recorded file, or on the recording of a scene and a seed."""
    if isinstance(item, Path):
        of, recording, truth = item.stem, mpucal.load(item), None
    else:
        simulated = SCENES[item[0]].simulate(item[1])
        of, recording, truth, gravity = item[0], simulated.recording, simulated.truth, GRAVITY_MPS2
    return [grade(of, method, recording, gravity, truth) for method in METHODS if method not in without]


def digits(name: str, places: int = 3) -> Column:
    """Return a column: the first row's figure with `places` decimals."""
    return lambda of: f"{value:.{places}f}" if np.isfinite(value := getattr(of[0], name)) else ""


SIMULATED: Mapping[str, Column] = {
    "error, m/s²": over("error"),
    "worst": over("error", max),
    "worse than none": count("worse"),
    "no result": count("why"),
    "ms": over("ms"),
    "why there is none": lambda of: "; ".join(dict.fromkeys(g.why for g in of if g.why)),
}
RECORDED: Mapping[str, Column] = {
    "|a|: median": digits("median"),
    "mean": digits("mean"),
    "sd": digits("std"),
    "rests |a| - g": digits("rest_rms", 4),
    "gyro misses, deg": digits("miss_median", 2),
    "at most": digits("miss_max", 2),
    "ms": over("ms"),
    "note": lambda of: of[0].why or of[0].note,
}


def report(grades: list[Grade], asked: Asked) -> None:
    """Print a line a method, beside the paper's of real recordings."""
    beside = PAPER_4_1 if asked.recordings else ()
    show(table(grouped([*grades, *beside], "of", "method"), RECORDED if asked.recordings else SIMULATED))


USUAL = "12 poses;six faces;three turns;continuous"
main = Program(
    __doc__,
    graded,
    items=lambda asked: asked.recordings or [(scene, seed) for scene in asked.scenes for seed in asked.seeds],
    report=report,
    options=(
        option("recordings", nargs="*", type=Path, help="files that mpucal reads; none: simulated hands"),
        option("--scenes", type=names_of(SCENES), default=USUAL, help=f"simulated, between ; [{USUAL}]"),
        option("--without", action="append", choices=[*METHODS][2:], default=[], help="leave a method out"),
        option("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2, of the recordings"),
    ),
    seeds="0:5",
)
