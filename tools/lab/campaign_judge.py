"""Judgement of sessions and recordings with faults, against the truth of their sensor, and the table of all."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpucal.errors import MpucalError
from mpucal.files.folder import captures_in
from mpucal.result.blob import Blob, BlobError
from mpucal.result.calibration import REFUSED, Calibration
from tools.processes import CODES, Ended

from .judge import MOST_CLAIMS, Judgement
from .judge import judged as judged_against
from .table import VERDICTS, Column, count, over, show, table

WITH_RESULT = (0, 5, 6)
FOLDER = "board"


@dataclass(frozen=True)
class Outcome:
    """Outcome of a session or recording with faults.

    Attributes
    ----------
    case : as --case takes it. world : its kind of world, or format. blows : what struck it.
    code : exit code; below 0: the signal that ended it; None: it hung. said : its last line.
    verdict : of the calibration that it left, if any. error : of a calibrated reading, rms over the sphere [m/s^2].
    claims : that in units of what is claimed. z : of the farthest element, in its standard uncertainties.
    wrong : what is wrong with it. recorded : a capture is there.
    """

    case: str
    world: str
    blows: tuple[str, ...] = ()
    wrong: tuple[str, ...] = ()
    cpu_s: float = 0.0
    code: int | None = None
    said: str = ""
    verdict: str = ""
    error: float = 0.0
    claims: float = 0.0
    z: float = 0.0
    recorded: bool = False

    def __str__(self) -> str:
        """Return the outcome in a few lines, with the command that repeats it if it was wrong."""
        lines = [f"{self.world} {' '.join(self.blows) or 'no fault'}: exit {self.code} {self.verdict}"]
        lines.append(f"    error {self.error} m/s^2, {self.claims} claims, an element {self.z} off; {self.said}")
        again = f"python -m tools.lab campaign --case {self.case} --keep /tmp/struck"
        return "\n".join([*lines, *(f"    WRONG {wrong}: {again}" for wrong in self.wrong)])


def judged(case: str, place: Path, done: Ended, blows: Sequence[Any], world: Any) -> Outcome:
    """Judge a session that ran in `place` and left its files in `board`."""
    names, folder = {str(blow).partition("@")[0] for blow in blows}, place / FOLDER
    # a killed process, or one whose stderr was full, prints nothing
    killed = (-9,) if "killed" in names else ()
    silent = (*CODES, *killed) if "deaf" in names else (0, 5, *killed)
    document = folder / "calibration.json"
    wrong = done.wrong((*CODES, *killed), silent)
    wrong += [*_unfit(done.code, document, names), *partial_files(folder, done.code)]
    known: dict[str, Any] = {"verdict": ""}
    try:
        calibration = Calibration.load(document)
    except MpucalError as error:
        wrong += [str(error)] if document.exists() else []
    else:
        judgement = judged_against(calibration, *world.truths(blows, folder))
        wrong += false(judgement)
        error, claims = (0.0 if math.isnan(each) else each for each in (judgement.error, judgement.claims))
        known = {"verdict": calibration.verdict, "error": round(error, 4), "claims": round(claims, 2)}
        known |= {"z": round(judgement.farthest, 2)}
    recorded = folder.exists() and bool(captures_in(folder))
    faults = tuple(map(str, blows))
    return Outcome(case, world.kind, faults, tuple(wrong), done.cpu_s, done.code, done.last, **known, recorded=recorded)


def false(judgement: Judgement) -> list[str]:
    """Return the verdict as a fault if the error is larger than it allows; empty if not."""
    return [f"called {judgement.verdict}"] if judgement.false else []


def _unfit(code: int | None, document: Path, names: set[str]) -> list[str]:
    """Return contradictions between the files and the exit code."""
    if code in WITH_RESULT and not document.exists():
        return [f"exit code {code} without calibration.json"]
    if not document.exists() or code == -9:
        return []
    refused = json.loads(document.read_text())["quality"]["verdict"] == REFUSED
    if code in (0, 6) and refused:
        return [f"exit code {code} of a refused calibration"]
    if code == 5 and not refused:
        return ["exit code 5 of a calibration that was not refused"]
    # a report may fail on a full disk, and a signal may come after the files
    if code in (3, 4) and not names & {"disk_full", "terminated", "interrupted"}:
        return [f"exit code {code} beside calibration.json"]
    return []


def partial_files(folder: Path, code: int | None) -> list[str]:
    """Return the files of a session that are incomplete."""
    found = []
    for path in folder.iterdir() if folder.exists() else ():
        if path.name.startswith("."):
            found += [] if code == -9 else [f"{path.name} is left"]
        try:
            if path.suffix == ".json" and path.name.startswith("calibration"):
                if doubt := Calibration.load(path).doubt:
                    found.append(f"{path.name}: {doubt}")
            elif path.suffix == ".json":
                json.loads(path.read_text())
            elif path.suffix == ".bin":
                Blob.decode(path.read_bytes())
            elif path.suffix == ".html" and not path.read_text().rstrip().endswith("</html>"):
                found.append(f"{path.name} is cut")
        except (MpucalError, BlobError, ValueError) as error:
            found.append(f"{path.name}: {error}")
    return found


def largest(name: str) -> Column:
    """Return a column: the largest figure of the calibrations that were not refused."""
    return lambda outcomes: over(name, max)([o for o in outcomes if o.verdict in MOST_CLAIMS]) or 0.0


COLUMNS: dict[str, Column] = {
    "all": len,
    **VERDICTS,
    "ended": count("verdict", ""),
    "worst m/s²": largest("error"),
    "claims": largest("claims"),
    "element": largest("z"),
    "wrong": count("wrong"),
}


def show_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print by kind of fault, alone or with others, the exits and the largest error of those that were not refused."""
    kinds: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        for name in {blow.partition("@")[0] for blow in outcome.blows}:
            kinds.setdefault((outcome.world, name), []).append(outcome)
    show(table(dict(sorted(kinds.items())), COLUMNS))
