"""Compare ways to calibrate on the same recordings: mpucal's, the paper's, six positions, an ellipsoid, imucal.

python -m tools.lab compare                                       simulated hands, against their truth
python -m tools.lab compare recordings/*.npz                      real recordings, by their rests and magnitudes
python -m tools.lab compare --without "the paper's algorithm"     which takes half a minute a recording
python -m tools.lab compare --scenes '12 poses' --seeds 20 --json compare.json
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.errors import MpucalError
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import GRAVITY_MPS2

from .monte_carlo import SCENES
from .rivals import Estimate, Rests, Unfit, aligned_ellipsoid, ellipsoid, imucal, six_positions
from .table import grouped, show, table
from .trials import command_line, in_parallel, names_of, save

RAW, AUTO = "uncalibrated", "mpucal auto"


@dataclass(frozen=True)
class Grade:
    """What a method made of a recording; NaN where nobody knows.

    Attributes
    ----------
    of : the scene, or the recording. why : why there is no result, or nothing. note : what else to know of it.
    error, before : m/s^2, against the truth, over all directions, and without a calibration.
    median, mean, std : m/s^2, of the magnitude of all samples.
    rest_rms : m/s^2, of the rests' magnitudes less gravity. miss_median, miss_max : deg, by which gravity, carried from
        rest to rest by the gyroscope, misses what the accelerometer says there.
    """

    of: str
    method: str
    why: str = ""
    note: str = ""
    seconds: float = np.nan
    error: float = np.nan
    before: float = np.nan
    median: float = np.nan
    mean: float = np.nan
    std: float = np.nan
    rest_rms: float = np.nan
    miss_median: float = np.nan
    miss_max: float = np.nan


# section 4.1, Galaxy S5: mean and sd of the magnitude after calibration; nothing is printed of before
PAPER_4_1 = (
    Grade("the paper, gravity 9.82", "six poses", mean=9.81, std=0.23),
    Grade("the paper, gravity 9.82", "continuous", mean=9.80, std=0.30),
)


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
    note = f"{chosen}{result.verdict}{f' ({codes})' if codes else ''}"
    return Estimate(result.D, result.b_a, result.K, result.b_omega, note)


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


def grade(of: str, method: str, recording: Recording, gravity: float, truth: SensorTruth | None = None) -> Grade:
    """Calibrate by a method, and judge what it gives."""
    began = time.perf_counter()
    try:
        estimate = METHODS[method](recording, gravity)
    except (Unfit, MpucalError, np.linalg.LinAlgError) as error:
        return Grade(of, method, why=str(error))
    seconds = np.nan if method == RAW else time.perf_counter() - began
    a = np.linalg.norm((recording.acc - estimate.b_a) @ np.linalg.inv(estimate.D).T, axis=1)
    return Grade(
        of,
        method,
        note=estimate.note,
        seconds=seconds,
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
    known = {"rest_rms": float(np.sqrt(np.mean((np.linalg.norm(s, axis=1) - gravity) ** 2)))}
    misses = np.degrees(rests.misses_rad(estimate.D, estimate.b_a, estimate.K))
    if len(misses):
        known |= {"miss_median": float(np.median(misses)), "miss_max": float(misses.max())}
    return known


def of_simulated(item: tuple[str, int], methods: Sequence[str]) -> list[Grade]:
    """The methods on the recording of a scene and a seed."""
    scene, seed = item
    simulated = SCENES[scene].simulate(seed)
    return [grade(scene, method, simulated.recording, GRAVITY_MPS2, simulated.truth) for method in methods]


def of_file(path: Path, gravity: float, methods: Sequence[str]) -> list[Grade]:
    """The methods on a recorded file."""
    recording = mpucal.load(path)
    return [grade(path.stem, method, recording, gravity) for method in methods]


def known(grades: Sequence[Grade], key: str) -> list[float]:
    """The values of those that have one; one NaN where none has."""
    return [value for g in grades if np.isfinite(value := getattr(g, key))] or [np.nan]


SIMULATED: Mapping[str, Callable[[Sequence[Grade]], object]] = {
    "error, m/s²": lambda of: float(np.mean(known(of, "error"))),
    "worst": lambda of: max(known(of, "error")),
    "worse than none": lambda of: sum(g.error > g.before for g in of),
    "no result": lambda of: sum(bool(g.why) for g in of),
    "ms": lambda of: 1e3 * float(np.mean(known(of, "seconds"))),
    "why there is none": lambda of: "; ".join(Counter(g.why for g in of if g.why)),
}
RECORDED: Mapping[str, Callable[[Sequence[Grade]], object]] = {
    "|a|: median": lambda of: _digits(of[0].median),
    "mean": lambda of: _digits(of[0].mean),
    "sd": lambda of: _digits(of[0].std),
    "rests |a| - g": lambda of: _digits(of[0].rest_rms, 4),
    "gyro misses, deg": lambda of: _digits(of[0].miss_median, 2),
    "at most": lambda of: _digits(of[0].miss_max, 2),
    "ms": lambda of: 1e3 * of[0].seconds,
    "note": lambda of: of[0].why or of[0].note,
}


def _digits(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else ""


def main() -> None:
    """Compare, print and save."""
    parser = command_line(__doc__, seeds="0:5")
    parser.add_argument("recordings", nargs="*", type=Path, help="files that mpucal reads; none: simulated hands")
    scenes = names_of(SCENES)
    usual = "12 poses;six faces;three turns;continuous"
    parser.add_argument("--scenes", type=scenes, default=scenes(usual), help=f"simulated, between ; [{usual}]")
    parser.add_argument("--without", action="append", choices=[*METHODS][2:], default=[], help="leave a method out")
    parser.add_argument("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2, of the recordings")
    options = parser.parse_args()
    methods = tuple(method for method in METHODS if method not in options.without)
    if options.recordings:
        one = partial(of_file, gravity=options.gravity, methods=methods)
        found = [g for of in in_parallel(one, options.recordings, options.jobs, "recordings") for g in of]
        lines, columns = grouped([*found, *PAPER_4_1], lambda g: (g.of, g.method)), RECORDED
    else:
        items = [(scene, seed) for scene in options.scenes for seed in options.seeds]
        graded = in_parallel(partial(of_simulated, methods=methods), items, options.jobs, "simulations")
        found = [g for of in graded for g in of]
        lines, columns = grouped(found, lambda g: (g.of, g.method)), SIMULATED
    show(table(lines, columns), width=170)
    save(options.json, found)
