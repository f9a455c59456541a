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

import argparse
import gc
import json
import os
import pkgutil
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from mpucal.session.threads import ONE_THREAD

# before NumPy loads
os.environ.update(ONE_THREAD)

import numpy as np

import mpucal
from mpucal.__main__ import _keep_streams, run
from mpucal.chip.config import MAX_FRAMES_A_POLL, Config
from mpucal.disk import growing
from mpucal.mavlink.dialect import dialect
from mpucal.session import results, rotate

from .campaign_judge import Outcome, judged, table
from .campaign_recordings import struck_recordings
from .campaign_worlds import BRIDGE, CHIP, KINDS, VEHICLE, Blow, World
from .forked import Died, Task, Tell, forked

CASES = 16
# a session that aims at less ends sooner: how often each, and until when faults begin
TARGETS = (*("quick",) * 7, "normal")
LAST_S = {"quick": 50.0, "normal": 66.0}
CHIPS = ("mpu6050", "mpu6500", "clone98")
HANDS = (*("guided",) * 6, "wandering", "placing", "random")
RATES = (50, 25, 100, 25)
FIRMWARES = ("ardupilot", "px4")
# a report is made for one of so many
REPORTS = 8
# once for every so many of the chip alone, which costs least
WORLDS = (*(CHIP,) * 15, BRIDGE, VEHICLE)
POLL_S, KNOW_EVERY_S, SELDOM = 0.5, 3.0, 8.0
CPU_S, WALL_S = 120, 600.0
FOLDER = "board"


@dataclass(frozen=True)
class Case:
    """One struck session: `number` of its prefix, `k` of the case, and what happens, the earliest first."""

    number: int
    k: int
    blows: tuple[Blow, ...]

    @property
    def name(self) -> str:
        """As --case takes it."""
        return f"{self.number}.{self.k}"


def world_of(number: int) -> str:
    """The kind of world of a prefix."""
    return WORLDS[number % len(WORLDS)]


def target_of(number: int) -> str:
    """What a prefix aims at."""
    return TARGETS[number // 2 % len(TARGETS)]


def drawn(number: int, k: int) -> Case:
    """What happens in a case."""
    rng = np.random.default_rng([number, k])
    names = rng.choice(KINDS[world_of(number)], rng.integers(1, 5)).tolist()
    last_s = LAST_S[target_of(number)]
    blows = [Blow(name, round(float(rng.uniform(0.0, last_s)), 2), int(rng.integers(1 << 31))) for name in names]
    return Case(number, k, tuple(sorted(blows, key=lambda blow: blow.at_s)))


def words(number: int) -> list[str]:
    """The command of a prefix."""
    to = ["--to", "chip"] if number % 3 == 0 else []
    if world_of(number) == VEHICLE:
        vehicle = f"sim:seed={number % 1000},firmware={FIRMWARES[number // 10 % 2]}"
        source, to = ["--mavlink", vehicle, "--rate", "50"], []
    else:
        chip = f"sim:seed={number % 100_000},chip={CHIPS[number % 3]},hand={HANDS[number // 3 % len(HANDS)]}"
        source = ["--bus", chip, "--rate", str(RATES[number // 7 % len(RATES)])]
    return ["session", *source, *to, "--target", target_of(number), "-o", FOLDER, "--yes"]


class Prefix:
    """One session without faults, and the struck ones that leave it."""

    def __init__(self, number: int, cases: Sequence[Case], place: Path) -> None:
        self._number, self._place = number, place
        self._world = World(world_of(number))
        self._child = False
        for case in cases:
            self._world.moments.add(case.blows[0].at_s, partial(self._leave, case))

    def run(self, tell: Tell) -> None:
        """To the end, of this process too; `tell` hears of each."""
        self._tell = tell
        here = self._place / "prefix"
        here.mkdir(parents=True)
        os.chdir(here)
        _redirect(here)
        _keep_streams()
        # a thread does not go on in a forked process
        with self._world.opened(), patch.object(growing.Syncing, "__init__", _unsynced), quick_polls():
            code = run(words(self._number))
        with suppress(OSError):
            sys.stdout.flush()
        if not self._child:
            outcome = judged(here, code, (), self._world)
            self._report(Case(self._number, -1, ()), outcome, 0.0)
            code = 0
        os._exit(code)

    def _leave(self, case: Case) -> None:
        if self._child:
            return
        sys.stdout.flush()
        place = self._place / str(case.k)
        pid = os.fork()
        if pid == 0:
            self._child = True
            if case.k % REPORTS:
                results.report = lambda _: None
            self._move(place)
            self._world.moments.due.clear()
            self._world.suffer(case.blows)
            return
        code, cpu_s = ended(pid)
        outcome = judged(place, code, case.blows, self._world)
        if outcome.recorded and code not in (0, 5):
            outcome = self._calibrated_after(place, outcome)
        self._report(case, outcome, cpu_s)
        if not os.environ.get("MPUCAL_KEEP"):
            shutil.rmtree(place)

    def _move(self, place: Path) -> None:
        """Everything that the session has open goes on in `place`."""
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

    def _calibrated_after(self, place: Path, outcome: Outcome) -> Outcome:
        """What is left of a session that did not end well is a recording, or no recording; never a trace."""
        pid = os.fork()
        if pid == 0:
            os.chdir(place)
            (place / "after").mkdir()
            _redirect(place / "after")
            _keep_streams()
            os._exit(run(["calibrate", FOLDER, "-o", "after/board"]))
        code, _ = ended(pid)
        said = (place / "after" / "err").read_text("utf-8", "replace")
        if code not in (0, 3, 5) or "Traceback" in said:
            return replace(outcome, wrong=(*outcome.wrong, f"calibrate afterwards: exit {code}"))
        return outcome

    def _report(self, case: Case, outcome: Outcome, cpu_s: float) -> None:
        line = {"case": case.name, "blows": [str(b) for b in case.blows], "world": self._world.kind, "cpu_s": cpu_s}
        self._tell({**line, **asdict(outcome)})


def _unsynced(durable_file: growing.Syncing, _file: object) -> None:
    durable_file.close = lambda: None


@contextmanager
def quick_polls() -> Iterator[None]:
    """A chip is looked at and a fit made as seldom as may be: processor time goes into what is to be tried."""
    period_s = property(lambda config: min(POLL_S, MAX_FRAMES_A_POLL / config.rate_hz))
    seldom = {"KNOW_EVERY_S": KNOW_EVERY_S, "SELDOM": SELDOM}
    with patch.object(Config, "period_s", period_s), patch.multiple(rotate, **seldom):
        yield


def ready() -> None:
    """Load what a session loads when it needs it, so that no fork has to."""
    for module in pkgutil.walk_packages(mpucal.__path__, "mpucal."):
        with suppress(ImportError):
            import_module(module.name)
    dialect()
    gc.freeze()


def _redirect(place: Path) -> None:
    for handle, name in ((1, "out"), (2, "err")):
        opened = os.open(place / name, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o644)
        os.dup2(opened, handle)
        os.close(opened)


def ended(pid: int) -> tuple[int | None, float]:
    """Exit code (below 0: the signal; None: it had to be killed) and processor time of a child."""
    until = time.monotonic() + WALL_S
    while time.monotonic() < until:
        done, status, usage = os.wait4(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime
        if cpu_s(pid) > CPU_S:
            break
        time.sleep(0.01)
    os.kill(pid, 9)
    os.waitpid(pid, 0)
    return None, float(CPU_S)


def cpu_s(pid: int) -> float:
    """That a process has used."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def sessions(prefixes: Sequence[tuple[int, Sequence[Case]]], jobs: int, place: Path) -> Iterator[dict]:
    """The outcomes, as they come."""
    tasks: list[Task] = [Prefix(number, cases, place / str(number)).run for number, cases in prefixes]
    for _, told in forked(tasks, jobs):
        died = {"case": "?", "world": "?", "blows": [], "wrong": [f"a prefix ended with {told}"], "cpu_s": 0.0}
        yield died if isinstance(told, Died) else told


def main() -> int:
    """Run them; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=0)
    parser.add_argument("--recordings", type=int, default=0)
    parser.add_argument("--first", type=int, default=datetime.now(UTC).date().toordinal() * 1000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--case", help="this one alone, PREFIX.NUMBER, or rNUMBER of a recording")
    parser.add_argument("--keep", type=Path, help="where its files stay")
    parser.add_argument("--json", type=Path, help="a line for each outcome")
    asked = parser.parse_args()
    print(f"seeds from {asked.first} on", flush=True)
    ready()
    with TemporaryDirectory() as temporary:
        place = asked.keep or Path(temporary)
        os.environ["XDG_STATE_HOME"] = str(place / "state")
        if asked.keep:
            os.environ["MPUCAL_KEEP"] = "1"
        begun, found = time.monotonic(), []
        for outcome in outcomes(asked, place):
            found.append(outcome)
            if outcome["wrong"] or asked.case:
                tell(outcome)
            if asked.json:
                with asked.json.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(outcome) + "\n")
        took_s = time.monotonic() - begun
    struck = [outcome for outcome in found if outcome["blows"]]
    cpu = sum(outcome["cpu_s"] for outcome in struck)
    print(table(struck))
    wrong = sum(bool(outcome["wrong"]) for outcome in found)
    print(f"{len(struck)} struck of {len(found)} in {took_s:.0f} s ({cpu:.0f} s of processor time): {wrong} wrong")
    return int(wrong > 0)


def outcomes(asked: argparse.Namespace, place: Path) -> Iterator[dict]:
    """Of what was asked for."""
    if asked.case and not asked.case.startswith("r"):
        number, k = map(int, asked.case.split("."))
        yield from sessions([(number, [drawn(number, k)])], 1, place)
        return
    if asked.case or asked.recordings:
        first, count = (int(asked.case[1:]), 1) if asked.case else (asked.first, asked.recordings)
        yield from struck_recordings(first, count, asked.jobs, place)
    numbers = range(asked.first, asked.first + -(-asked.sessions // CASES))
    for at in range(0, len(numbers), 10 * asked.jobs):
        batch = numbers[at : at + 10 * asked.jobs]
        yield from sessions([(n, [drawn(n, k) for k in range(CASES)]) for n in batch], asked.jobs, place)


def tell(outcome: dict) -> None:
    """One in a few lines."""
    what = " ".join(outcome["blows"]) or "no fault"
    print(f"{outcome['world']} {what}: exit {outcome.get('code')} {outcome.get('verdict') or ''}")
    print(f"    error {outcome.get('error')} m/s^2, {outcome.get('z')} claims; {outcome.get('said')}")
    for wrong in outcome["wrong"]:
        print(
            f"    WRONG {wrong}: python -m tools.lab campaign --case {outcome['case']} --keep /tmp/struck", flush=True
        )
