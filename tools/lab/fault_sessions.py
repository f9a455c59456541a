"""Sessions on a simulated chip that suffers faults at random moments: does any end in a wrong calibration?

    python -m tools.lab fault_sessions [--sessions N] [--rounds N] [--seed S] [--rate HZ]

Each session suffers one fault, or two, of mpucal/simulated/faults.py, and ends as a true calibration (what is
true lies within what is promised), a refusal, or a sentence that says what happened. Exit code 1 where one did not.
With --rounds, every fault and every pair of them befalls a recording, which is calibrated afterwards: without the
session's advice and the fits behind it, that takes a tenth of the time.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np

from mpucal.__main__ import run
from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import RefusedError, SourceError
from mpucal.result.calibration import REFUSED
from mpucal.session.events import Key
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.faults import OF_CHIP, Fault, kinds

# what is true may lie so many promised standard deviations away; nobody promises less than 1e-4
FARTHEST = 6.0
LEAST_STD = 1e-4
CODES = (0, 3, 4, 5)
CHIPS = ("mpu6050", "mpu6500", "clone98")
BEGIN_S, END_S = 0.0, 75.0
RECORDED_S, POLL_S = 45, 0.2
KINDS = kinds(*OF_CHIP)
# every kind alone, and every pair
COMBINATIONS = [*((name,) for name in KINDS), *combinations_with_replacement(KINDS, 2)]


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
    bus = f"sim:seed={seed},chip={CHIPS[seed % len(CHIPS)]}{_suffering(faults)}"
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


def recorded(faults: Sequence[Fault], seed: int, rate_hz: float = 50) -> Outcome:
    """Of one recording on a chip that suffers `faults`, of what there is of it."""
    bus = open_simulated(f"sim:seed={seed},chip={CHIPS[seed % len(CHIPS)]}{_suffering(faults)}")
    plan = Plan(Config(rate_hz=rate_hz, poll_s=POLL_S), until_end=True)
    driver, said = Driver(bus, plan.config), ""
    try:
        Runner(driver, Nobody(), lambda *_: None, plan, (bus.hear,)).record(RECORDED_S)
    except SourceError as error:
        said = str(error)
    recording = driver.recording()
    if len(recording) < 2:
        return Outcome(SourceError.exit_code, said)
    found, truth = calibrate(recording), bus.truth_document() or {}
    pairs = ((found.D, found.D_std, truth["D"]), (found.b_a, found.b_a_std, truth["b_a"]))
    code = RefusedError.exit_code if found.verdict == REFUSED else 0
    return Outcome(code, said, found.verdict, max(_off(*pair) for pair in pairs))


class Nobody:
    """Hears what is said, and presses nothing."""

    def hear(self, output: object) -> None:
        """Be told."""

    def pressed(self) -> Sequence[Key]:
        """Nothing."""
        return ()


def _suffering(faults: Sequence[Fault]) -> str:
    return ",fault=" + "/".join(map(str, faults)) if faults else ""


def _off(found: object, std: object, true: object) -> float:
    error = np.abs(np.array(found, np.float64) - np.array(true, np.float64))
    return float(np.nanmax(error / np.maximum(np.array(std, np.float64), LEAST_STD), initial=0.0))


def drawn(rng: np.random.Generator, number: int) -> tuple[Fault, ...]:
    """Each kind alone in turn, then pairs."""
    names = list(KINDS)
    return struck(rng, [names[number]] if number < len(names) else rng.choice(names, 2).tolist(), END_S)


def struck(rng: np.random.Generator, names: Sequence[str], end_s: float) -> tuple[Fault, ...]:
    """Each at its moment."""
    return tuple(Fault(name, round(float(rng.uniform(BEGIN_S, end_s)), 2)) for name in names)


def main() -> int:
    """Run them, and print each; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=3 * len(KINDS))
    parser.add_argument("--rounds", type=int, default=0, help="of recordings, one for each of all combinations")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=50.0)
    arguments = parser.parse_args()
    rng, ends, wrong = np.random.default_rng(arguments.seed), Counter[str](), 0
    count = arguments.rounds * len(COMBINATIONS) or arguments.sessions
    for number in range(count):
        if arguments.rounds:
            faults = struck(rng, COMBINATIONS[number % len(COMBINATIONS)], RECORDED_S)
            ended = recorded(faults, arguments.seed + number, arguments.rate)
        else:
            faults = drawn(rng, number)
            ended = outcome(faults, arguments.seed + number, arguments.rate)
        ends[ended.verdict or f"exit {ended.code}"] += 1
        wrong += ended.wrong
        mark = "WRONG " if ended.wrong else ""
        print(f"{mark}{'/'.join(map(str, faults)):32} {ended.verdict or ended.said} ({ended.off:.1f} std)", flush=True)
    print(f"{count} {'recordings' if arguments.rounds else 'sessions'}: {dict(ends)}; {wrong} wrong")
    return int(wrong > 0)
