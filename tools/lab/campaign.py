"""Campaign of thousands of sessions with faults, and of damaged recordings, each judged against the simulated truth.

    python -m tools.lab campaign --sessions 1000
    python -m tools.lab campaign --recordings 10000
    python -m tools.lab campaign --case 739000123.4 --keep /tmp/faults

Each session has one to four faults, drawn by the seed, of the kinds in campaign_worlds.py. It runs as a whole command,
to its files and its exit code. A recording is damaged as in campaign_recordings.py, and calibrated. A case is wrong if
a good or usable calibration is farther from the truth than it claims, if there is a traceback, a hang, an exit code
that does not fit or a failure without a sentence, or if a file is incomplete. A table counts the verdicts by kind of
fault. Each wrong case is printed with the command that repeats it. The seeds begin with the day's number. Exit code 1
means that a case was wrong.
"""

import os
from collections.abc import Sequence
from contextlib import nullcontext
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, NamedTuple

import numpy as np

from mpucal.__main__ import run
from tools.processes import Child, quick, ready, without_pictures

from .campaign_judge import FOLDER, judge_files
from .campaign_recordings import Damaged, of_recording, originals
from .campaign_worlds import BRIDGE, CHIP, KINDS, VEHICLE, TimedFault, World
from .judge import MOST_CLAIMS
from .runner import Trial
from .table import VERDICTS, Column, Row, count, over, show, table

CASES = 16  # cases, which differ in their faults, of each undisturbed session
# targets of sessions: how often each comes, and the last time [s] at which faults begin; a lower target ends sooner
TARGETS = (*("quick",) * 7, "normal")
LAST_S = {"quick": 50.0, "normal": 66.0}
CHIPS = ("mpu6050", "mpu6500", "clone98")
HANDS = (*("guided",) * 6, "wandering", "placing", "random")
RATES = (50, 25, 100, 25)
FIRMWARES = ("ardupilot", "px4")
# file that is made when the first fault begins
BEGUN = Path("begun")
# one session in this many draws the pictures of its report
PICTURES = 8
# a chip without bridge or vehicle takes least time, and comes most often
WORLDS = (*(CHIP,) * 15, BRIDGE, VEHICLE)


class Case(NamedTuple):
    """Session with faults, the earliest first; `number` determines the session, and `k` with it the faults."""

    number: int
    k: int
    faults: tuple[TimedFault, ...] = ()


def kind_of(number: int) -> tuple[str, str]:
    """Return the kind of world of a session, and the target."""
    return WORLDS[number % len(WORLDS)], TARGETS[number // 2 % len(TARGETS)]


def drawn(number: int, k: int) -> Case:
    """Draw the faults of a case."""
    rng = np.random.default_rng([number, k])
    world, target = kind_of(number)
    names, last_s = rng.choice(KINDS[world], rng.integers(1, 5)).tolist(), LAST_S[target]
    faults = [TimedFault(name, round(float(rng.uniform(0.0, last_s)), 2), int(rng.integers(1 << 31))) for name in names]
    return Case(number, k, tuple(sorted(faults, key=lambda fault: fault.at_s)))


def command_of(number: int) -> list[str]:
    """Return the command line of a session."""
    world, target = kind_of(number)
    to = ["--to", "chip"] if number % 3 == 0 else []
    if world == VEHICLE:
        vehicle = f"sim:seed={number % 1000},firmware={FIRMWARES[number // 10 % 2]}"
        source, to = ["--mavlink", vehicle, "--rate", "50"], []
    else:
        chip = f"sim:seed={number % 100_000},chip={CHIPS[number % 3]},hand={HANDS[number // 3 % len(HANDS)]}"
        source = ["--bus", chip, "--rate", str(RATES[number // 7 % len(RATES)])]
    return ["session", *source, *to, "--target", target, "-o", FOLDER, "--yes"]


def run_with_faults(case: Case, world: World) -> int:
    """Run a session in which the faults begin at their times; return its exit code."""

    def begin() -> None:
        BEGUN.touch()
        world.begin_faults(case.faults)

    os.environ["XDG_STATE_HOME"] = str(Path("state").resolve())
    world.at(case.faults[0].at_s, begin)
    with world.opened(), quick(), without_pictures() if case.k % PICTURES else nullcontext():
        return run(command_of(case.number))


def of_session(case: Case, here: Path) -> Row:
    """Run a session with faults in a process of its own, and judge it."""
    world = World(kind_of(case.number)[0])
    done = Child(partial(run_with_faults, case, world), here, here / "err").go().wait()
    faults = case.faults if (here / BEGUN).exists() else ()
    row = judge_files(f"{case.number}.{case.k}", here, done, faults, world)
    if faults and row.recorded and done.code not in (0, 5):
        # a session that failed leaves a recording or nothing
        (here / "after").mkdir()
        again = partial(run, ["calibrate", FOLDER, "-o", "after/board"])
        after = Child(again, here, here / "after" / "err").go().wait()
        row.wrong += [f"calibrate afterwards: {what}" for what in after.wrong((0, 3, 5), (0, 3, 5))]
    return row


def of_case(item: Case | Damaged, *, keep: Annotated[Path | None, "where its files stay"] = None) -> Row:
    """Run a session with faults, or calibrate a damaged recording, and judge it."""
    ready()
    with TemporaryDirectory() as temporary:
        here = (keep or Path(temporary)).resolve() / f"{item.number}.{item[1]}"
        here.mkdir(parents=True)
        return of_session(item, here) if isinstance(item, Case) else of_recording(item, here)


def scenarios(
    *,
    sessions: int = 0,
    recordings: int = 0,
    first: int = date.today().toordinal() * 1000,
    case: Annotated[str | None, "this one alone, NUMBER.K, or rNUMBER of a recording"] = None,
) -> Sequence[Case | Damaged]:
    """Return the recordings and sessions of the options."""
    print(f"seeds from {first} on", flush=True)
    if case and not case.startswith("r"):
        return [drawn(*map(int, case.split(".")))]
    numbers = range(int(case[1:]), int(case[1:]) + 1) if case else range(first, first + recordings)
    return [
        *(originals(numbers) if numbers else ()),
        *(drawn(first + n // CASES, n % CASES) for n in range(0 if case else sessions)),
    ]


def line(row: Row) -> str:
    """Return how a wrong case ended, what was wrong, and the command that repeats it; empty if nothing was wrong."""
    again = f"python -m tools.lab campaign --case {row.case} --keep /tmp/faults"
    return "\n".join([shown(row), *(f"    WRONG {wrong}: {again}" for wrong in row.wrong)]) if row.wrong else ""


def shown(row: Row) -> str:
    """Return how a case ended, in a few lines."""
    errors = f"error {row.error:.4f} m/s^2, {row.claims:.2f} claims, an element {row.farthest:.2f} off"
    return f"{row.world} {' '.join(row.faults) or 'no fault'}: exit {row.code} {row.verdict}\n    {errors}; {row.said}"


def largest(name: str) -> Column:
    """Return a column: the largest figure of the calibrations that were not refused."""
    return lambda rows: over(name, max)([row for row in rows if row.verdict in MOST_CLAIMS]) or 0.0


COLUMNS: dict[str, Column] = {
    "all": len,
    **VERDICTS,
    "ended": count("verdict", ""),
    "worst m/s²": largest("error"),
    "claims": largest("claims"),
    "element": largest("farthest"),
    "wrong": count("wrong"),
}


def report(found: list[Row]) -> int:
    """Print a table by kind of fault; a case with several faults counts in each row. Return 1 if a case was wrong."""
    with_faults, kinds = [row for row in found if row.faults], dict[tuple[str, str], list[Row]]()
    for row in with_faults:
        for name in {fault.partition("@")[0] for fault in row.faults}:
            kinds.setdefault((row.world, name), []).append(row)
    show(table(dict(sorted(kinds.items())), COLUMNS))
    if len(found) == 1:
        print(shown(found[0]))
    cpu_s, wrong = sum(row.cpu_s for row in with_faults), sum(bool(row.wrong) for row in found)
    print(f"{len(with_faults)} with faults of {len(found)} in {cpu_s:.0f} s of processor time: {wrong} wrong")
    return int(wrong > 0)


main = Trial(__doc__, of_case, scenarios, report=report, line=line)
