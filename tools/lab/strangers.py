"""Recordings of other people: tries until each is read, its verdict, |a| of its rests, and if its halves agree.

python -m tools.lab strangers recordings/*.csv folder/

A try adds the options that the error message before it suggests. |a| of the rests is compared with an ellipsoid that is
fitted to all rests but one, and judged by that one. Halves are cut in the middle of a rest, and both calibrated: z are
the differences of D and b_a in units of what both claim, which are 1 if the standard deviations are true.
"""

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.errors import MpucalError, RecordingError

from .halves import agreement, halves
from .judge import rms
from .rivals import Rests, Unfit, ellipsoid
from .runner import Trial
from .table import Column, Row, first, over

MOST_TRIES, MOST_LEFT_OUT = 5, 60


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
        said: dict[str, Any] = {
            word.removeprefix("--").replace("-", "_"): value
            for word, value in zip(words[::2], words[1::2], strict=True)
        }
        for key in said.keys() & {"rate", "accel_range", "gyro_range"}:
            said[key] = float(said[key])
        if not said.keys() - given.keys():
            break
        given |= said
    return None, 0, why


def of_path(path: Path, *, gravity: Annotated[float, "m/s^2"] = STANDARD_GRAVITY_MPS2) -> Row:
    """Read a recording, calibrate it, and judge its rests: rms of |a| - g, raw, calibrated, and by an ellipsoid."""
    name = f"{path.parent.name}/{path.name}"
    recording, tries, why = read(path)
    if recording is None:
        return Row(name=name, tries=0, verdict=why)
    calibration = mpucal.calibrate(recording, gravity=gravity)
    reasons = ", ".join(reason["code"] for reason in calibration.quality["reasons"])
    found = Row(name=name, tries=tries, verdict=f"{calibration.verdict} ({calibration.fit['model']}) {reasons}".strip())
    try:
        rests = Rests.of(recording)
    except Unfit:
        return found
    found.rests, found.before = len(rests.y), _off(rests.y, gravity)
    if np.isfinite(calibration.D).all() and len(rests.y):
        found.after = _off(calibration.apply(rests.y), gravity)
    found.left_out, found.z = left_out(rests, gravity), halves_z(recording, gravity)
    return found


def halves_z(recording: Recording, gravity: float) -> tuple[float, ...]:
    """Return (12,) how the calibrations of the halves differ; empty where there are none."""
    try:
        one, other = (mpucal.calibrate(half, gravity=gravity) for half in halves(recording))
    except (MpucalError, Unfit):
        return ()
    return agreement(one, other)


def left_out(rests: Rests, gravity: float) -> float:
    """Return the rms of |a| - g [mm/s^2] of each rest by an ellipsoid fitted to the others; NaN if it is open."""
    errors = []
    for k in range(min(len(rests.y), MOST_LEFT_OUT)):
        try:
            of_others = ellipsoid(replace(rests, runs=np.delete(rests.runs, k, axis=0)), gravity)
        except Unfit:
            return float("nan")
        errors.append(float(np.linalg.norm(np.linalg.solve(of_others.D, rests.y[k] - of_others.b_a))) - gravity)
    return 1e3 * rms(errors)


def _off(acc: Any, gravity: float) -> float:
    return 1e3 * rms((np.linalg.norm(acc, axis=1) - gravity).tolist())


COLUMNS: dict[str, Column] = {
    "try": lambda of: of[0].tries or "never",
    "rests": first("rests"),
    "before": over("before"),
    "after": over("after"),
    "ellipsoid": over("left_out"),
    "halves, rms z": over("z", rms),
    "largest |z|": over("z", lambda z: np.abs(z).max()),
    "verdict": first("verdict"),
}


def scenarios(recordings: Annotated[Sequence[Path], "files and folders that mpucal reads"]) -> Sequence[Path]:
    """Return the recordings."""
    return recordings


TITLE = "rms of |a| - g of the rests, mm/s²; the ellipsoid's of one left out"
main = Trial(__doc__, of_path, scenarios, COLUMNS, title=TITLE)
