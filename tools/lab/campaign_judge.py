"""Judgement of a command with faults: its files, its exit code, and its calibration against the truth."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpucal.errors import MpucalError
from mpucal.result.blob import Blob, BlobError
from mpucal.result.calibration import REFUSED, Calibration
from mpucal.result.session_files import captures_in
from tools.processes import CODES, Ended

from .judge import judged, judgement
from .table import Row

WITH_RESULT = (0, 5, 6)
FOLDER = "board"


def judge_files(case: str, place: Path, done: Ended, faults: Sequence[Any], world: Any) -> Row:
    """Judge a command that ran in `place` and left its files in `board`; `recorded`: a capture is there.

    world : has a `kind`, and gives the `truths` of its sensor with these faults.
    """
    names, folder = {str(fault).partition("@")[0] for fault in faults}, place / FOLDER
    # a killed process, or one whose stderr was full, prints nothing
    killed = (-9,) if "killed" in names else ()
    silent = (*CODES, *killed) if "deaf" in names else (0, 5, *killed)
    document = folder / "calibration.json"
    wrong = done.wrong((*CODES, *killed), silent)
    wrong += [*_unfit(done.code, document, names), *partial_files(folder, done.code)]
    row = judgement()
    try:
        row = judged(Calibration.load(document), *world.truths(faults, folder))
    except MpucalError as error:
        wrong += [str(error)] if document.exists() else []
    wrong += [f"called {row.verdict}"] if row.false else []
    vars(row).update(case=case, world=world.kind, faults=tuple(map(str, faults)), wrong=wrong)
    recorded = folder.exists() and bool(captures_in(folder))
    vars(row).update(cpu_s=done.cpu_s, code=done.code, said=done.last, recorded=recorded)
    return row


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
