"""Section 4.2 of the paper on recordings with optical motion capture: an accelerometer distorted by a known D and b_a.

python -m tools.lab distorted recordings/broad_01.npz
python -m tools.lab distorted recordings/broad_01.npz --seeds 8 --json distorted.json

The file holds t, acc, gyr and quat (n, 4), w, x, y, z from the sensor to an earth with z up, NaN where it was not seen.
A good accelerometer is taken as perfect, and spoilt: gains by 10 %, skew by 5 deg, misalignment by 3 deg, biases by
1 m/s^2, all uniform.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

import mpucal
from mpucal.calibration.masks import with_masks
from mpucal.data import Recording, Vector
from mpucal.errors import RecordingError
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.result.keys import Model
from mpucal.simulated.rotation import up_in_board
from mpucal.simulated.sensor import SensorTruth

from .judge import followed, sph_rms, tilts_deg
from .runner import Trial, each_seed
from .scenarios.sensors import draw_D
from .table import Column, Row, grouped, over, show, table

GAIN, SKEW_RAD, MISALIGNMENT_RAD, BIAS_MPS2 = 0.1, np.radians(5.0), np.radians(3.0), 1.0
SETS = ("uncalibrated", "calibrated", "with the gyroscope's K", "undistorted")
FIGURES = ("which", "error", "roll_deg", "pitch_deg", "roll_turned_deg", "pitch_turned_deg")


BESIDE = (
    Row(name="wanted", which="", error=0.094, roll_deg=0.47, pitch_deg=0.22),
    # the paper's means over its optical recording
    Row(name="the paper", which="before", roll_deg=3.43, pitch_deg=1.61),
    Row(name="the paper", which="after", roll_deg=1.82, pitch_deg=0.78),
)


def captured(path: Path, gravity: float) -> tuple[Recording, Vector]:
    """Load a .npz with t, acc, gyr and quat; the specific force (n, 3) [m/s^2] is NaN where motion capture saw nothing.

    Raises
    ------
    RecordingError : no quat in it.
    """
    with np.load(path) as file:
        if "quat" not in file:
            raise RecordingError(f"{path}: it holds no quat", "give a recording with optical motion capture")
        recording = Recording.from_arrays(file["t"], file["acc"], file["gyr"], name=path.stem)
        return with_masks(recording), gravity * up_in_board(np.asarray(file["quat"], float))


def distortion(seed: int) -> tuple[Vector, Vector]:
    """Return D (3, 3) and b_a (3,) [m/s^2] of a seed."""
    rng = np.random.default_rng(seed)
    return draw_D(rng, GAIN, SKEW_RAD, MISALIGNMENT_RAD), rng.uniform(-BIAS_MPS2, BIAS_MPS2, 3)


def of_seed(
    item: tuple[Path, int],
    *,
    model: Model = "auto",
    gravity: Annotated[float, "m/s^2"] = 9.81,
) -> list[Row]:
    """Distort, calibrate, and judge each of SETS by the distortion [m/s^2] and by motion capture [deg].

    The tilts are means from the end of the flat segment on; the `turned` ones are so without the rest at the end, which
    flatters the mean.

    Raises
    ------
    RecordingError : nothing could be estimated.
    """
    path, seed = item
    good, s_true = captured(path, gravity)
    D_true, b_true = distortion(seed)
    recording = replace(good, acc=good.acc @ D_true.T + b_true)
    result = mpucal.calibrate(recording, model=model, gravity=gravity)
    if not np.isfinite(result.D).all():
        raise RecordingError(f"{path}: nothing could be estimated", "see what `mpucal calibrate` says of it")
    truth = SensorTruth(D_true, b_true, np.eye(3), np.zeros(3), gravity)
    D = np.array([np.eye(3), result.D, result.D, D_true])
    b_a = np.array([np.zeros(3), result.b_a, result.b_a, b_true])
    s, turned_until = orientations(recording, D, b_a, result.K, gravity)
    s_true = s_true[-len(s) :]
    errors = [sph_rms(truth, *sets) for sets in zip(D, b_a, strict=True)]
    tilts = (*tilts_deg(s_true, s), *tilts_deg(s_true[:turned_until], s[:turned_until]))
    same = {"name": path.stem, "seed": seed, "told": f"{result.fit['model']}, {result.verdict}"}
    same["claim"] = float(result.quality["error_std"]["rms"] or np.nan)
    return [Row(**same, **dict(zip(FIGURES, each, strict=True))) for each in zip(SETS, errors, *tilts, strict=True)]


def orientations(recording: Recording, D: Vector, b_a: Vector, K: Vector, gravity: float) -> tuple[Vector, int]:
    """Return gravity (n, 4, 3) [m/s^2] as the paper's EKF finds it with each of SETS after the flat segment.

    The number beside it counts the samples before the last rest.
    """
    segment = find_flat(recording)
    if segment is None:
        raise RecordingError(f"{recording.name}: it does not begin at rest", "give a recording that does")
    flat = flat_statistics(recording, segment)
    corrected = replace(recording, gyr=recording.gyr @ K.T)
    s = followed(recording, flat, D, b_a, gravity)
    s[:, 2:3] = followed(corrected, flat_statistics(corrected, segment), D[2:3], b_a[2:3], gravity)
    return s, int(RestFinder(recording, flat).typical()[-1, 0]) - flat.last


COLUMNS: dict[str, Column] = {
    "error, m/s²": over("error"),
    "worst": over("error", max),
    "claimed": over("claim"),
    "roll, deg": over("roll_deg"),
    "pitch, deg": over("pitch_deg"),
    "roll, without the rest at the end": over("roll_turned_deg"),
    "pitch": over("pitch_turned_deg"),
    "verdicts": lambda of: "; ".join(sorted({e.told for e in of if hasattr(e, "told")})),
}


def scenarios(
    recordings: Annotated[Sequence[Path], ".npz with t, acc, gyr and quat"], *, seeds: range
) -> list[tuple[Path, int]]:
    """Return each recording with each seed."""
    return each_seed(recordings, seeds)


def report(found: list[Row]) -> None:
    """Print a line for each of SETS, beside what is wanted and the paper's."""
    show(table(grouped([*found, *BESIDE], "name", "which"), COLUMNS, "section 4.2"))


main = Trial(__doc__, of_seed, scenarios, report=report, seeds="0:4")
