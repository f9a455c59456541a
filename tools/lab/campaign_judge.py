"""How a struck session or recording ended, judged against what is true of its sensor; and the table of them all."""

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
from mpucal.result.calibration import GOOD, REFUSED, USABLE, Calibration

from .judge import MOST_CLAIMS, Judgement
from .judge import judged as judged_against

# what is false by the lab's judge is wrong only where it is farther from the truth than what matters [m/s^2]
LEAST_ERROR = 0.1
CODES = (0, 3, 4, 5, 6)
WITH_RESULT = (0, 5, 6)


@dataclass(frozen=True)
class Outcome:
    """How one ended.

    Attributes
    ----------
    code : exit code; below 0: the signal that ended it; None: it hung. said : its last line.
    verdict : of the calibration that it left, if any. error : of a calibrated reading, rms over the sphere [m/s^2].
    z : that in units of what is claimed. wrong : what is wrong with it. recorded : a capture is there.
    """

    code: int | None
    said: str
    verdict: str = ""
    error: float = 0.0
    z: float = 0.0
    wrong: tuple[str, ...] = ()
    recorded: bool = False


def judged(place: Path, code: int | None, blows: Sequence[Any], world: Any) -> Outcome:
    """A session that ran in `place` and left its files in `board`."""
    said = (place / "err").read_text("utf-8", "replace")
    names = {blow.name for blow in blows}
    folder = place / "board"
    wrong = []
    if code is None:
        wrong.append("it hung")
    elif code not in CODES and not (code == -9 and "killed" in names):
        wrong.append(f"exit code {code}")
    if "Traceback" in said:
        wrong.append("a trace")
    last = (said.strip().splitlines() or [""])[-1]
    if code not in (0, 5, -9) and "deaf" not in names and not last.startswith("mpucal: "):
        wrong.append("no sentence")
    document = folder / "calibration.json"
    wrong += _unfit(code, document, names)
    wrong += _parts(folder, code)
    recorded = folder.exists() and bool(captures_in(folder))
    try:
        calibration = Calibration.load(document)
    except MpucalError as error:
        wrong += [str(error)] if document.exists() else []
        return Outcome(code, last, wrong=tuple(wrong), recorded=recorded)
    judgement = judged_against(calibration, *world.truths(blows, folder))
    wrong += false(judgement)
    error, z = (0.0 if math.isnan(each) else each for each in (judgement.error, judgement.claims))
    return Outcome(code, last, calibration.verdict, round(error, 4), round(z, 2), tuple(wrong), recorded)


def false(judgement: Judgement) -> list[str]:
    """Whether it promises what it does not hold."""
    return [f"called {judgement.verdict}"] if judgement.false and judgement.error > LEAST_ERROR else []


def _unfit(code: int | None, document: Path, names: set[str]) -> list[str]:
    """What the files say that the exit code does not."""
    if code in WITH_RESULT and not document.exists():
        return [f"exit code {code} without calibration.json"]
    if not document.exists() or code == -9:
        return []
    refused = json.loads(document.read_text())["quality"]["verdict"] == REFUSED
    if code in (0, 6) and refused:
        return [f"exit code {code} of a refused calibration"]
    if code == 5 and not refused:
        return ["exit code 5 of a calibration that was not refused"]
    # a report that had no room, a signal after the files
    if code in (3, 4) and not names & {"disk_full", "terminated", "interrupted"}:
        return [f"exit code {code} beside calibration.json"]
    return []


def _parts(folder: Path, code: int | None) -> list[str]:
    """Files that are not whole."""
    found = []
    if not folder.exists():
        return found
    for path in folder.iterdir():
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


def table(outcomes: Sequence[dict[str, Any]]) -> str:
    """By kind of fault: how they ended, and the worst error of those that were not refused."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for outcome in outcomes:
        for name in sorted({blow.partition("@")[0] for blow in outcome["blows"]}):
            kinds.setdefault(f"{outcome['world']} {name}", []).append(outcome)
    head = f"{'fault (alone or among others)':<32}{'all':>6}{'good':>7}{'usable':>7}{'refused':>8}{'ended':>7}"
    lines = [f"{head}{'worst m/s^2':>13}{'claims':>8}{'wrong':>7}"]
    for kind, some in sorted(kinds.items()):
        counts = [sum(o.get("verdict") == verdict for o in some) for verdict in (GOOD, USABLE, REFUSED, "")]
        promised = [o for o in some if o.get("verdict") in MOST_CLAIMS]
        error, z = (max((o[key] for o in promised), default=0.0) for key in ("error", "z"))
        wrong = sum(bool(o["wrong"]) for o in some)
        good, usable, refused, ended = counts
        row = f"{kind:<32}{len(some):>6}{good:>7}{usable:>7}{refused:>8}{ended:>7}{error:>13.3f}{z:>8.1f}{wrong:>7}"
        lines.append(row)
    return "\n".join(lines)
