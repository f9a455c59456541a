"""Whole sessions on a simulated chip that suffers faults at random moments: does any end in a wrong calibration?

    python tools/fault_sessions.py [--sessions N] [--seed S] [--rate HZ]

Each session suffers one fault, or two, of mpucal/bus/simulated/faults.py, and ends as a true calibration (what is
true lies within what is promised), a refusal, or a sentence that says what happened. Exit code 1 where one did not.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mpucal.__main__ import run
from mpucal.bus.simulated.faults import KINDS, Fault

# what is true may lie so many promised standard deviations away; nobody promises less than 1e-4
FARTHEST = 6.0
LEAST_STD = 1e-4
CODES = (0, 3, 4, 5)
CHIPS = ("mpu6050", "mpu6500", "clone98")
BEGIN_S, END_S = 0.0, 75.0


@dataclass(frozen=True)
class Outcome:
    """How a session ended.

    Attributes
    ----------
    code : exit code. said : its last line. verdict : of its calibration, if there is one.
    off : how far D and b_a lie from the truth, in promised standard deviations.
    trace : whether it ended in a trace.
    """

    code: int
    said: str
    verdict: str = ""
    off: float = 0.0
    trace: bool = False

    @property
    def wrong(self) -> bool:
        """A bug, or a wrong calibration that is called good."""
        return self.trace or self.code not in CODES or (self.verdict == "good" and self.off > FARTHEST)


def outcome(faults: Sequence[Fault], seed: int, rate_hz: float = 50, model: str = "auto") -> Outcome:
    """Of one session on a chip that suffers `faults`."""
    bus = f"sim:seed={seed},chip={CHIPS[seed % len(CHIPS)]}"
    if faults:
        bus += ",fault=" + "/".join(map(str, faults))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "session"
        words = ["session", "--bus", bus, "--rate", f"{rate_hz:g}", "--model", model, "-o", str(folder), "--json"]
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            code = run([*words, "--yes"])
        said = (err.getvalue().splitlines() or [""])[-1]
        trace = "Traceback" in err.getvalue()
        if not out.getvalue():
            return Outcome(code, said, trace=trace)
        found, truth = json.loads(out.getvalue()), json.loads((folder / "truth.json").read_text())
    sensor = found["accelerometer"]
    off = max(_off(sensor[name], sensor[f"{name}_std"], truth[name]) for name in ("D", "b_a"))
    return Outcome(code, said, found["quality"]["verdict"], off, trace)


def _off(found: object, std: object, true: object) -> float:
    error = np.abs(np.array(found, np.float64) - np.array(true, np.float64))
    return float(np.nanmax(error / np.maximum(np.array(std, np.float64), LEAST_STD), initial=0.0))


def drawn(rng: np.random.Generator, number: int) -> tuple[Fault, ...]:
    """Each kind alone in turn, then pairs."""
    names = list(KINDS)
    chosen = [names[number]] if number < len(names) else rng.choice(names, 2).tolist()
    return tuple(Fault(name, round(float(rng.uniform(BEGIN_S, END_S)), 2)) for name in chosen)


def main() -> int:
    """Run them, and print each; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=3 * len(KINDS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=50.0)
    arguments = parser.parse_args()
    rng, ends, wrong = np.random.default_rng(arguments.seed), Counter[str](), 0
    for number in range(arguments.sessions):
        faults = drawn(rng, number)
        ended = outcome(faults, arguments.seed + number, arguments.rate)
        ends[ended.verdict or f"exit {ended.code}"] += 1
        wrong += ended.wrong
        mark = "WRONG " if ended.wrong else ""
        print(f"{mark}{'/'.join(map(str, faults)):32} {ended.verdict or ended.said} ({ended.off:.1f} std)", flush=True)
    print(f"{arguments.sessions} sessions: {dict(ends)}; {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
