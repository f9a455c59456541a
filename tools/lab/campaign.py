"""Thousands of sessions that faults strike, each judged against the simulated truth.

    python -m tools.lab campaign --sessions 1000
    python -m tools.lab campaign --recordings 10000
    python -m tools.lab campaign --case 739000123.4 --keep /tmp/struck

Each session suffers one to four faults, drawn by the seed, of all kinds of campaign_worlds.py, to the end of the whole
command, files and exit code included. Wrong is: a good or usable calibration that is farther from the truth than it
claims, a trace, a hang, an exit code that does not fit, no sentence, a file in part. A table counts verdicts by kind of
fault; a wrong case comes with the command that repeats it. Seeds begin with the day's number. Exit code 1 where one was
wrong.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np

from mpucal.__main__ import run
from mpucal.session import results
from tools.processes import Child, Died, Task, Tell, forked, quick, ready
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
# left where the first fault begins
BEGUN = Path("begun")
# one session in this many makes a report
REPORTS = 8
# the chip alone is cheapest, and comes most often
WORLDS = (*(CHIP,) * 15, BRIDGE, VEHICLE)


@dataclass(frozen=True)
class Case:
    """Session with faults: `number` of the undisturbed one, `k` of the case, and the faults, the earliest first."""

    number: int
    k: int
    blows: tuple[TimedFault, ...] = ()

    @property
    def name(self) -> str:
        """Return the case as --case takes it."""
        return f"{self.number}.{self.k}"


def kind_of(number: int) -> tuple[str, str]:
    """Return the kind of world of a session, and the target."""
    return WORLDS[number % len(WORLDS)], TARGETS[number // 2 % len(TARGETS)]


def drawn(number: int, k: int) -> Case:
    """Draw the faults of a case."""
    rng = np.random.default_rng([number, k])
    world, target = kind_of(number)
    names, last_s = rng.choice(KINDS[world], rng.integers(1, 5)).tolist(), LAST_S[target]
    blows = [TimedFault(name, round(float(rng.uniform(0.0, last_s)), 2), int(rng.integers(1 << 31))) for name in names]
    return Case(number, k, tuple(sorted(blows, key=lambda blow: blow.at_s)))


def words(number: int) -> list[str]:
    """Return the command of a session."""
    world, target = kind_of(number)
    to = ["--to", "chip"] if number % 3 == 0 else []
    if world == VEHICLE:
        vehicle = f"sim:seed={number % 1000},firmware={FIRMWARES[number // 10 % 2]}"
        source, to = ["--mavlink", vehicle, "--rate", "50"], []
    else:
        chip = f"sim:seed={number % 100_000},chip={CHIPS[number % 3]},hand={HANDS[number // 3 % len(HANDS)]}"
        source = ["--bus", chip, "--rate", str(RATES[number // 7 % len(RATES)])]
    return ["session", *source, *to, "--target", target, "-o", FOLDER, "--yes"]


def suffer(case: Case, world: World) -> int:
    """Run a session that the faults strike from the first on; return its exit code."""

    def begin() -> None:
        BEGUN.touch()
        world.begin_faults(case.blows)

    if case.k % REPORTS:
        results.report = lambda _: None
    world.moments.add(case.blows[0].at_s, begin)
    with world.opened(), quick():
        return run(words(case.number))


def of_session(case: Case, place: Path, keep: bool, tell: Tell) -> None:
    """Run a session with faults in a process of its own, and judge it."""
    world, here = World(kind_of(case.number)[0]), place / case.name
    here.mkdir(parents=True)
    done = Child(partial(suffer, case, world), here, here / "err").go().wait()
    blows = case.blows if (here / BEGUN).exists() else ()
    outcome = judged(case.name, here, done, blows, world)
    if blows and outcome.recorded and done.code not in (0, 5):
        # a session that failed leaves a recording or nothing
        (here / "after").mkdir()
        again = partial(run, ["calibrate", FOLDER, "-o", "after/board"])
        after = Child(again, here, here / "after" / "err").go().wait()
        wrong = [f"calibrate afterwards: {what}" for what in after.wrong((0, 3, 5), (0, 3, 5))]
        outcome = replace(outcome, wrong=(*outcome.wrong, *wrong))
    tell(outcome)
    if not keep:
        shutil.rmtree(here)


def outcomes(
    first: int, count: int, recordings: int, case: str | None, jobs: int, place: Path, keep: bool
) -> Iterator[Outcome]:
    """Yield the outcomes of the sessions and recordings of the options, in the order in which they end."""
    cases = [drawn(first + n // CASES, n % CASES) for n in range(count)]
    if case and case.startswith("r"):
        first, recordings = int(case[1:]), 1
    elif case:
        cases = [drawn(*map(int, case.split(".")))]
    yield from struck_recordings(first, recordings, jobs, place) if recordings else ()
    tasks: list[Task] = [partial(of_session, each, place, keep) for each in cases]
    for _, told in forked(tasks, jobs):
        yield Outcome("?", "?", wrong=(f"a session ended with {told}",)) if isinstance(told, Died) else told


def main(
    *,
    sessions: int = 0,
    recordings: int = 0,
    first: int = date.today().toordinal() * 1000,
    jobs: Jobs = PROCESSORS,
    case: Annotated[str | None, "this one alone, NUMBER.K, or rNUMBER of a recording"] = None,
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
