"""Recordings of other people: the try at which each is read, its verdict, and |a| of its rests before and after.

python -m tools.lab strangers recordings/*.csv folder/

A try adds the options that the error message before it suggests. |a| of the rests is compared with an ellipsoid that is
fitted to all rests but one, and judged by that one.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.errors import MpucalError, RecordingError

from .judge import rms
from .rivals import Rests, Unfit, ellipsoid
from .runner import Asked, Program, option
from .table import Column, grouped, over, show, table

MOST_TRIES, MOST_LEFT_OUT = 5, 60


@dataclass(frozen=True)
class Tried:
    """Result for a recording.

    Attributes
    ----------
    tries : number of tries until it was read, 0 if never. verdict : with model and reasons. rests : their number.
    before, after : rms of |a| - g of the rests, raw and calibrated. left_out : that of an ellipsoid, each rest judged
    by a fit to the others [mm/s^2].
    """

    name: str
    tries: int = 0
    verdict: str = ""
    rests: int = 0
    before: float = float("nan")
    after: float = float("nan")
    left_out: float = float("nan")


def read(path: Path) -> tuple[Recording | None, int, str]:
    """Return the recording, the number of tries, 0 if it was never read, and why it was not."""
    given: dict[str, Any] = {}
    why = ""
    for count in range(1, MOST_TRIES + 1):
        try:
            return mpucal.load(path, **given), count, ""
        except MpucalError as error:
            why = str(error)
            words = shlex.split(error.options) if isinstance(error, RecordingError) else []
        said = {
            word.removeprefix("--").replace("-", "_"): value
            for word, value in zip(words[::2], words[1::2], strict=True)
        }
        for key in said.keys() & {"rate", "accel_range", "gyro_range"}:
            said[key] = float(said[key])
        if not said.keys() - given.keys():
            break
        given |= said
    return None, 0, why


def of_path(path: Path, gravity: float) -> Tried:
    """Read a recording, calibrate it, and judge its rests."""
    name = f"{path.parent.name}/{path.name}"
    recording, tries, why = read(path)
    if recording is None:
        return Tried(name, verdict=why)
    calibration = mpucal.calibrate(recording, gravity=gravity)
    reasons = ", ".join(reason["code"] for reason in calibration.quality["reasons"])
    found = Tried(name, tries, f"{calibration.quality['verdict']} ({calibration.fit['model']}) {reasons}".strip())
    try:
        rests = Rests.of(recording)
    except Unfit:
        return found
    found = replace(found, rests=len(rests.y), before=_off(rests.y, gravity))
    if np.isfinite(calibration.D).all() and len(rests.y):
        found = replace(found, after=_off(calibration.apply(rests.y), gravity))
    return replace(found, left_out=left_out(rests, gravity))


def left_out(rests: Rests, gravity: float) -> float:
    """Return the rms of |a| - g [mm/s^2] of each rest by an ellipsoid fitted to the others; NaN if it is open."""
    errors = []
    for k in range(min(len(rests.y), MOST_LEFT_OUT)):
        try:
            of_others = ellipsoid(replace(rests, runs=np.delete(rests.runs, k, axis=0)), gravity)
        except Unfit:
            return float("nan")
        errors.append(np.linalg.norm(np.linalg.solve(of_others.D, rests.y[k] - of_others.b_a)) - gravity)
    return 1e3 * rms(errors)


def _off(acc: Any, gravity: float) -> float:
    return 1e3 * rms((np.linalg.norm(acc, axis=1) - gravity).tolist())


COLUMNS: dict[str, Column] = {
    "try": lambda of: of[0].tries or "never",
    "rests": lambda of: of[0].rests,
    "before": over("before"),
    "after": over("after"),
    "ellipsoid": over("left_out"),
    "verdict": lambda of: of[0].verdict,
}


def report(found: list[Tried], asked: Asked) -> None:
    """Print a line a recording."""
    show(
        table(grouped(found, "name"), COLUMNS, "rms of |a| - g of the rests [mm/s^2]; the ellipsoid's of one left out")
    )


main = Program(
    __doc__,
    of_path,
    items=lambda asked: asked.recordings,
    report=report,
    options=(
        option("recordings", nargs="+", type=Path, help="files and folders that mpucal reads"),
        option("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2"),
    ),
)
