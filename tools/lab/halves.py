"""Are the claimed standard deviations true? D and b_a of the two halves of a recording, cut in the middle of a rest.

python -m tools.lab halves recordings/*.npz

Simulations are compared with their truth by monte_carlo.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

import mpucal
from mpucal.calibration import MODELS
from mpucal.calibration.masks import with_masks
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.errors import MpucalError, RecordingError
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder

from .judge import rms
from .runner import Trial
from .table import Column, Row, grouped, over, show, table

LEAST_REST_S = 1.0


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """Return both halves of a recording, each of which begins at rest.

    The cut is in the middle of the rest nearest to the middle. Where the board rests only at the start and at the end,
    it is in the middle, and the second half is read backwards: gravity and accelerations are the same then, rates are
    reversed.

    Raises
    ------
    RecordingError : the board rests neither at the start nor at the end.
    """
    recording = with_masks(recording)
    flat = recording.flat or find_flat(recording)
    if flat is None:
        raise RecordingError(f"{recording.name}: no rest to begin with", "give a recording that begins at rest")
    runs = RestFinder(recording, flat_statistics(recording, flat)).typical()
    runs = runs[runs[:, 1] - runs[:, 0] >= LEAST_REST_S * recording.rate_hz]
    n, middle = len(recording), (flat[1] + len(recording)) // 2
    inner = runs[(runs[:, 0] > flat[1]) & (np.abs(runs.mean(1) - middle) < 0.25 * n)]
    if len(inner):
        first, last = min(inner.tolist(), key=lambda run: abs(sum(run) // 2 - middle))
        cut = (first + last) // 2
        return replace(recording.part(0, cut), flat=flat), replace(recording.part(cut, n), flat=(0, last - cut))
    # a rest that began before the cut is cut, too
    first, last = np.maximum(runs[-1], middle).tolist() if len(runs) else (n, n)
    if last < 0.9 * n or last - first < LEAST_REST_S * recording.rate_hz:
        raise RecordingError(f"{recording.name}: no second rest", "give a recording that ends at rest")
    backwards = reversed_in_time(recording.part(middle, n))
    return replace(recording.part(0, middle), flat=flat), replace(backwards, flat=(n - last, n - first))


def reversed_in_time(recording: Recording) -> Recording:
    """Return the recording of the same motion backwards in time."""
    return replace(
        recording,
        t=recording.t[-1] - recording.t[::-1],
        acc=recording.acc[::-1].copy(),
        gyr=-recording.gyr[::-1],
        temperature_c=recording.temperature_c[::-1].copy(),
        # samples missing before one are missing after it, backwards
        gap=np.append(False, recording.gap[:0:-1]),
        acc_clipped=recording.acc_clipped[::-1].copy(),
        gyr_clipped=recording.gyr_clipped[::-1].copy(),
        flat=None,
    )


def agreement(name: str, one: mpucal.Calibration, other: mpucal.Calibration) -> Row:
    """Compare two calibrations of one sensor: z are differences of D row-major and b_a in units of what both claim."""
    difference = np.append(one.D - other.D, one.b_a - other.b_a)
    std = np.hypot(np.append(one.D_std, one.b_a_std), np.append(other.D_std, other.b_a_std))
    models = "/".join(dict.fromkeys(str(half.fit["model"]) for half in (one, other)))
    if not np.isfinite(difference).all():
        return Row(name=name, model=models, why="nothing could be estimated")
    z = tuple((difference / std).tolist())
    return Row(name=name, model=models, z=z, rms_z=rms(z), why=None)


def of_file(
    path: Path,
    *,
    model: Annotated[str, MODELS] = "auto",
    gravity: Annotated[float, "m/s^2"] = STANDARD_GRAVITY_MPS2,
) -> Row:
    """Cut a recorded file, calibrate both halves and compare them."""
    try:
        one, other = (mpucal.calibrate(half, model=model, gravity=gravity) for half in halves(mpucal.load(path)))
    except MpucalError as error:
        return Row(name=path.stem, model=model, why=str(error))
    return agreement(path.stem, one, other)


COLUMNS: dict[str, Column] = {
    "runs": len,
    "rms z, median": over("rms_z", np.median),
    "rms z, worst": over("rms_z", max),
    "largest |z|": over("z", lambda z: np.abs(z).max()),
    "why there is none": lambda of: next((a.why for a in of if a.why), None),
}


def scenarios(recordings: Annotated[list[Path], "files that mpucal reads"]) -> list[Path]:
    """Return the recordings."""
    return recordings


def report(found: list[Row]) -> None:
    """Print a line for each recording, and one for all recordings by each model."""
    of_all = {("all", model): rows for model, rows in grouped(found, "model").items()}
    show(table(grouped(found, "name", "model") | of_all, COLUMNS, WANTED))


# rms z of 12 parameters: 1 for a true claim, and the limits of the median and the worst
WANTED = "halves of recordings; wanted: median 0.7 to 1.3, worst 2 or less"
main = Trial(__doc__, of_file, scenarios, report=report)
