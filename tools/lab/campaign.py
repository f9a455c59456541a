"""Thousands of sessions that faults strike, each judged against the simulated truth.

    python -m tools.lab campaign --sessions 1000
    python -m tools.lab campaign --recordings 10000
    python -m tools.lab campaign --case 739000123.4 --keep /tmp/struck

A session runs once without a fault; at each instant at which faults begin it forks, and the child suffers them (one to
four, drawn by the seed, of all kinds of campaign_worlds.py) to the end of the whole command, files and exit code
included. Wrong is: a good or usable calibration that is farther from the truth than it claims, a trace, a hang, an exit
code that does not fit, no sentence, a file in part. A table counts verdicts by kind of fault; a wrong case comes with
the command that repeats it. Seeds begin with the day's number. Exit code 1 where one was wrong.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np

from mpucal.__main__ import run
from mpucal.session import results
from tools.processes import Child, Died, Ended, Task, Tell, become, ended, forked, limit_cpu, quick, ready
from tools.programs import PROCESSORS, Jobs

from .campaign_judge import FOLDER, Outcome, judged, show_outcomes
from .campaign_recordings import struck_recordings
from .campaign_worlds import BRIDGE, CHIP, KINDS, VEHICLE, TimedFault, World

CASES = 16
# targets of sessions: how often each comes, and the last time [s] at which faults begin; a lower target ends sooner
TARGETS = (*("quick",) * 7, "normal")
LAST_S = {"quick": 50.0, "normal": 66.0}
CHIPS = ("mpu6050", "mpu6500", "clone98")
HANDS = (*("guided",) * 6, "wandering", "placing", "random")
RATES = (50, 25, 100, 25)
FIRMWARES = ("ardupilot", "px4")
# one session in this many makes a report
REPORTS = 8
# the chip alone is cheapest, and comes most often
WORLDS = (*(CHIP,) * 15, BRIDGE, VEHICLE)


@dataclass(frozen=True)
class Case:
    """Session with faults: `number` of its prefix, `k` of the case, and the faults, the earliest first."""

    number: int
    k: int
    blows: tuple[TimedFault, ...] = ()

    @property
    def name(self) -> str:
        """Return the case as --case takes it."""
        return f"{self.number}.{self.k}"


def kind_of(number: int) -> tuple[str, str]:
    """Return the kind of world of a prefix, and the target."""
    return WORLDS[number % len(WORLDS)], TARGETS[number // 2 % len(TARGETS)]


def drawn(number: int, k: int) -> Case:
    """Draw the faults of a case."""
    rng = np.random.default_rng([number, k])
    world, target = kind_of(number)
    names, last_s = rng.choice(KINDS[world], rng.integers(1, 5)).tolist(), LAST_S[target]
    blows = [TimedFault(name, round(float(rng.uniform(0.0, last_s)), 2), int(rng.integers(1 << 31))) for name in names]
    return Case(number, k, tuple(sorted(blows, key=lambda blow: blow.at_s)))


def words(number: int) -> list[str]:
    """Return the command of a prefix."""
    world, target = kind_of(number)
    to = ["--to", "chip"] if number % 3 == 0 else []
    if world == VEHICLE:
        vehicle = f"sim:seed={number % 1000},firmware={FIRMWARES[number // 10 % 2]}"
        source, to = ["--mavlink", vehicle, "--rate", "50"], []
    else:
        chip = f"sim:seed={number % 100_000},chip={CHIPS[number % 3]},hand={HANDS[number // 3 % len(HANDS)]}"
        source = ["--bus", chip, "--rate", str(RATES[number // 7 % len(RATES)])]
    return ["session", *source, *to, "--target", target, "-o", FOLDER, "--yes"]


class Prefix:
    """Session without faults, from which sessions with faults are forked."""

    def __init__(self, number: int, cases: Sequence[Case], place: Path, keep: bool) -> None:
        self._number, self._place, self._keep = number, place, keep
        self._world = World(kind_of(number)[0])
        self._child, self._left = False, not cases
        for case in cases:
            self._world.moments.add(case.blows[0].at_s, partial(self._leave, case))

    def run(self, tell: Tell) -> None:
        """Run the session to its end and end this process; pass the outcome of each case to `tell`."""
        self._tell = tell
        here = self._place / "prefix"
        here.mkdir(parents=True)
        become(here, here / "err")
        with self._world.opened(), quick():
            code = run(words(self._number))
        with suppress(OSError):
            sys.stdout.flush()
        if not self._child:
            if not self._left:
                self._tell(Outcome(f"{self._number}.-1", self._world.kind, wrong=("no fault began",)))
            self._judge(Case(self._number, -1), here, Ended(code, (here / "err").read_text("utf-8", "replace")))
            code = 0
        os._exit(code)

    def _leave(self, case: Case) -> None:
        if self._child:
            return
        self._left = True
        place = self._place / str(case.k)
        pid = os.fork()
        if pid == 0:
            self._child = True
            limit_cpu()
            if case.k % REPORTS:
                results.report = lambda _: None
            self._move(place)
            self._world.moments.due.clear()
            self._world.begin_faults(case.blows)
            return
        self._judge(case, place, ended(pid, place / "err"))
        if not self._keep:
            shutil.rmtree(place)

    def _judge(self, case: Case, place: Path, done: Ended) -> None:
        outcome = judged(case.name, place, done, case.blows, self._world)
        if case.blows and outcome.recorded and done.code not in (0, 5):
            # a session that failed leaves a recording or nothing
            (place / "after").mkdir()
            again = partial(run, ["calibrate", FOLDER, "-o", "after/board"])
            after = Child(again, place, place / "after" / "err").go().wait()
            wrong = [f"calibrate afterwards: {what}" for what in after.wrong((0, 3, 5), (0, 3, 5))]
            outcome = replace(outcome, wrong=(*outcome.wrong, *wrong))
        self._tell(outcome)

    def _move(self, place: Path) -> None:
        """Move all files that the session has open to `place`."""
        shutil.copytree(Path.cwd(), place)
        here = f"{Path.cwd()}/"
        for link in Path("/proc/self/fd").iterdir():
            handle = int(link.name)
            with suppress(OSError):
                target = str(link.readlink())
                if target.startswith(here):
                    at, there = os.lseek(handle, 0, os.SEEK_CUR), place / target.removeprefix(here)
                    moved = os.open(there, os.O_RDONLY if there.is_dir() else os.O_RDWR | os.O_CREAT)
                    os.lseek(moved, at, os.SEEK_SET)
                    os.dup2(moved, handle)
                    os.close(moved)
        os.chdir(place)


def run_all(prefixes: Sequence[tuple[int, Sequence[Case]]], jobs: int, place: Path, keep: bool) -> Iterator[Outcome]:
    """Yield the outcomes in the order in which they end."""
    tasks: list[Task] = [Prefix(number, cases, place / str(number), keep).run for number, cases in prefixes]
    for _, told in forked(tasks, jobs):
        yield Outcome("?", "?", wrong=(f"a prefix ended with {told}",)) if isinstance(told, Died) else told


def outcomes(
    first: int, count: int, recordings: int, case: str | None, jobs: int, place: Path, keep: bool
) -> Iterator[Outcome]:
    """Yield the outcomes of the sessions and recordings of the options."""
    if case and not case.startswith("r"):
        number, k = map(int, case.split("."))
        yield from run_all([(number, [drawn(number, k)])], 1, place, keep)
    elif case:
        yield from struck_recordings(int(case[1:]), 1, jobs, place)
    elif recordings:
        yield from struck_recordings(first, recordings, jobs, place)
    numbers = range(first, first + -(-count // CASES))
    for at in range(0, len(numbers), 10 * jobs):
        batch = [(n, [drawn(n, k) for k in range(CASES)]) for n in numbers[at : at + 10 * jobs]]
        yield from run_all(batch, jobs, place, keep)


def main(
    *,
    sessions: int = 0,
    recordings: int = 0,
    first: int = date.today().toordinal() * 1000,
    jobs: Jobs = PROCESSORS,
    case: Annotated[str | None, "this one alone, PREFIX.NUMBER, or rNUMBER of a recording"] = None,
    keep: Annotated[Path | None, "where its files stay"] = None,
) -> int:
    """Run the campaign; return the exit code."""
    print(f"seeds from {first} on", flush=True)
    ready()
    begun, found = time.monotonic(), list[Outcome]()
    with TemporaryDirectory() as temporary:
        place = keep or Path(temporary)
        os.environ["XDG_STATE_HOME"] = str(place / "state")
        for outcome in outcomes(first, sessions, recordings, case, jobs, place, bool(keep)):
            found.append(outcome)
            if outcome.wrong or case:
                print(outcome, flush=True)
    struck = [outcome for outcome in found if outcome.blows]
    show_outcomes(struck)
    took_s, cpu_s = time.monotonic() - begun, sum(outcome.cpu_s for outcome in struck)
    wrong = sum(bool(outcome.wrong) for outcome in found)
    print(f"{len(struck)} struck of {len(found)} in {took_s:.0f} s ({cpu_s:.0f} s of processor time): {wrong} wrong")
    return int(wrong > 0)
