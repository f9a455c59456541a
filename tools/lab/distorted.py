"""Section 4.2 of the paper on recordings with optical motion capture: an accelerometer distorted by a known D and b_a.

python -m tools.lab distorted recordings/broad_01.npz
python -m tools.lab distorted recordings/broad_01.npz --runs 8 --json distorted.json

The file holds t, acc, gyr and quat (n, 4), w, x, y, z from the sensor to an earth with z up, NaN where it was not seen.
A good accelerometer is taken as perfect, and spoilt: gains by 10 %, skew by 5 deg, misalignment by 3 deg, biases by
1 m/s^2, all uniform.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import mpucal
from mpucal.calibration import MODELS
from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.calibration.flat_segment import find_flat, flat_statistics
from mpucal.calibration.masks import with_masks
from mpucal.calibration.static_intervals import static_intervals
from mpucal.data import Recording, Vector
from mpucal.errors import RecordingError
from mpucal.simulated.sensor import SensorTruth, non_orthogonality, turned
from tools.lab.study.metrics import sph_rms, tilt_errors_deg

from .monte_carlo import in_parallel
from .tables import number

GAIN, SKEW_RAD, MISALIGNMENT_RAD, BIAS_MPS2 = 0.1, np.radians(5.0), np.radians(3.0), 1.0
GOALS = {"sph_rms": 0.094, "roll_deg": 0.47, "pitch_deg": 0.22}
# the paper's means over its optical recording, before and after
PAPER_4_2 = ((3.43, 1.61), (1.82, 0.78))
SETS = ("uncalibrated", "calibrated", "with the gyroscope's K", "undistorted")


@dataclass(frozen=True)
class Run:
    """What a seed's distortion gave; errors are those of SETS.

    Attributes
    ----------
    sph_rms : m/s^2 against the distortion. claimed : what the calibration said of it.
    roll_deg, pitch_deg : means of the absolute errors against the motion capture, from the end of the flat segment.
    roll_turned_deg, pitch_turned_deg : the same without the rest at the end, which flatters the mean.
    """

    seed: int
    model: str
    verdict: str
    claimed: float
    sph_rms: tuple[float, ...]
    roll_deg: tuple[float, ...]
    pitch_deg: tuple[float, ...]
    roll_turned_deg: tuple[float, ...]
    pitch_turned_deg: tuple[float, ...]


@dataclass(frozen=True)
class Captured:
    """A recording and the specific force (n, 3) [m/s^2] that motion capture gives, NaN where it saw nothing."""

    recording: Recording
    specific_force: Vector

    @classmethod
    def load(cls, path: Path, gravity: float) -> Captured:
        """Of a .npz with t, acc, gyr and quat.

        Raises
        ------
        RecordingError : no quat in it.
        """
        with np.load(path) as file:
            if "quat" not in file:
                raise RecordingError(f"{path}: it holds no quat", "give a recording with optical motion capture")
            recording = Recording.from_arrays(file["t"], file["acc"], file["gyr"], name=path.stem)
            w, x, y, z = np.asarray(file["quat"], float).T
        # the last row of the rotation from sensor to earth: the earth's z in the sensor's axes
        up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z], axis=1)
        return cls(with_masks(recording), gravity * up)


def distortion(seed: int) -> tuple[Vector, Vector]:
    """(3, 3) and (3,) m/s^2, of a seed."""
    rng = np.random.default_rng(seed)
    gain = 1.0 + rng.uniform(-GAIN, GAIN, 3)
    skew = rng.uniform(-SKEW_RAD, SKEW_RAD, 3)
    turn = rng.uniform(-MISALIGNMENT_RAD, MISALIGNMENT_RAD, 3)
    return np.diag(gain) @ non_orthogonality(*skew) @ turned(-turn), rng.uniform(-BIAS_MPS2, BIAS_MPS2, 3)


def of_seed(seed: int, path: Path, model: str, gravity: float) -> Run:
    """Distort, calibrate, and judge by the distortion and by motion capture.

    Raises
    ------
    RecordingError : nothing could be estimated.
    """
    captured = Captured.load(path, gravity)
    D_true, b_true = distortion(seed)
    recording = replace(captured.recording, acc=captured.recording.acc @ D_true.T + b_true)
    result = mpucal.calibrate(recording, model=model, gravity=gravity)
    if not np.isfinite(result.D).all():
        raise RecordingError(f"{path}: nothing could be estimated", "see what `mpucal calibrate` says of it")
    truth = SensorTruth(D_true, b_true, np.eye(3), np.zeros(3), gravity)
    D = np.array([np.eye(3), result.D, result.D, D_true])
    b_a = np.array([np.zeros(3), result.b_a, result.b_a, b_true])
    s, turned = orientations(recording, D, b_a, result.K, gravity)
    s_true = captured.specific_force[-len(s) :]
    return Run(
        seed,
        result.fit["model"],
        result.verdict,
        float(result.quality["error_std"]["rms"]),
        tuple(sph_rms(truth, *sets) for sets in zip(D, b_a, strict=True)),
        *tilt_errors(s_true, s),
        *tilt_errors(s_true[:turned], s[:turned]),
    )


def orientations(recording: Recording, D: Vector, b_a: Vector, K: Vector, gravity: float) -> tuple[Vector, int]:
    """(n, 4, 3) m/s^2, gravity as the paper's EKF finds it with each of SETS after the flat segment.

    The number beside it counts the samples before the last rest.
    """
    flat = flat_statistics(recording, _flat(recording))
    s = np.zeros((len(recording) - flat.last, len(SETS), 3))
    corrected = replace(recording, gyr=recording.gyr @ K.T)
    for of_gyro, sets in ((recording, [0, 1, 3]), (corrected, [2])):
        ekf = Ekf.after(flat_statistics(of_gyro, (flat.first, flat.last)), of_gyro, gravity)
        x = np.concatenate([block.x for block in ekf.run(D[sets], b_a[sets])])
        s[:, sets] = specific_force(x, gravity)
    return s, int(static_intervals(recording, flat)[-1, 0]) - flat.last


def tilt_errors(s_true: Vector, s: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Roll and pitch errors [deg] of s (n, 4, 3) against s_true (n, 3), where motion capture saw it."""
    seen = np.isfinite(s_true).all(1)
    errors = [tilt_errors_deg(s_true[seen], s[seen, k]) for k in range(s.shape[1])]
    return tuple(roll for roll, _ in errors), tuple(pitch for _, pitch in errors)


def _flat(recording: Recording) -> tuple[int, int]:
    flat = find_flat(recording)
    if flat is None:
        raise RecordingError(f"{recording.name}: it does not begin at rest", "give a recording that does")
    return flat


def table(name: str, runs: list[Run]) -> Table:
    """Means over the seeds, beside the goals and the paper's."""
    lines = Table("", title=f"section 4.2: {name}, {len(runs)} distortions")
    for column in ("sph_rms, m/s²", "worst", "roll, deg", "pitch, deg"):
        lines.add_column(column, justify="right")
    for k, name_of_set in enumerate(SETS):
        sph = [run.sph_rms[k] for run in runs]
        roll, pitch, roll_turned, pitch_turned = (
            np.mean([getattr(run, key)[k] for run in runs])
            for key in ("roll_deg", "pitch_deg", "roll_turned_deg", "pitch_turned_deg")
        )
        tilts = (f"{roll:.2f} ({roll_turned:.2f})", f"{pitch:.2f} ({pitch_turned:.2f})")
        lines.add_row(name_of_set, number(float(np.mean(sph))), number(max(sph)), *tilts)
    lines.add_section()
    lines.add_row("wanted", f"{GOALS['sph_rms']:g}", "", f"{GOALS['roll_deg']:g}", f"{GOALS['pitch_deg']:g}")
    for when, (roll, pitch) in zip(("before", "after"), PAPER_4_2, strict=True):
        lines.add_row(f"the paper's, {when}", "", "", f"{roll:.2f}", f"{pitch:.2f}")
    claimed = number(float(np.mean([run.claimed for run in runs])))
    verdicts = ", ".join(sorted({f"{run.model}, {run.verdict}" for run in runs}))
    lines.caption = f"in brackets: without the rest at the end; claimed sph_rms {claimed}; {verdicts}"
    return lines


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path, help=".npz with t, acc, gyr and quat")
    parser.add_argument("--runs", type=int, default=4, help="distortions of each")
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--model", choices=MODELS, default="auto")
    parser.add_argument("--gravity", type=float, default=9.81, help="m/s^2")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    return parser.parse_args()


def main() -> None:
    """Distort, calibrate, print and save."""
    options = arguments()
    console = Console(width=120)
    document: dict[str, Any] = {}
    seeds = range(options.seed, options.seed + options.runs)
    for path in options.recordings:
        one = partial(of_seed, path=path, model=options.model, gravity=options.gravity)
        runs = list(in_parallel(one, seeds, options.jobs, path.stem))
        console.print(table(path.stem, runs))
        document[path.stem] = [asdict(run) for run in runs]
    if options.json:
        options.json.write_text(json.dumps(document, indent=1) + "\n")
