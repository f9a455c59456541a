"""Run processes that share a folder or a file name, and disturb their files.

    python -m tools.attack shared --pairs 40 --eights 10 --meddled 10 --ended 8

A race forks so many processes, which begin together: sessions and recordings of a simulated chip into one -o, and into
none. Meddling renames a session's folder, or cuts, removes or replaces its capture. Ending sends KILL, TERM, HUP or
ALRM to a batch and to a session at any time, and counts the processes that are left of it after ten seconds. It is
judged whether one process at most ends well for each capture that is there, whether each capture is whole and the
results beside it are its own, and whether all others end with a sentence. Exit code 1: what is said last was not so.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory

from mpucal.__main__ import run
from mpucal.calibration import recording_digest
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from tools.processes import Child, Ended, ready

SESSION = ("session", "--rate", "25", "--target", "quick", "--yes", "--no-write")
RECORD = ("record", "--seconds", "2")
RECORDED = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
# largest time between two starts [s]
APART_S = 0.02
# A process that waits for others on a busy computer does not hang; one that computes ends by its processor time.
ENDS_S = 900.0
# time in which a command starts all its processes, and time after which none may be left [s]
LONGEST_START_S, LEFT_S = 4.0, 10.0
# called with the kind of a trial, and what was wrong; empty if nothing was
Tell = Callable[[str, str], None]


@contextmanager
def folder() -> Iterator[Path]:
    """Yield an empty folder, with room beside it for the output of the processes."""
    with TemporaryDirectory() as place:
        (here := Path(place) / "here").mkdir()
        yield here


def begin(words: Sequence[str], here: Path, number: int = 0) -> Child:
    """Fork a command that waits until Child.go."""
    return Child(partial(run, list(words)), here, here.parent / f"said-{number}")


def odd_end(done: Ended, codes: Sequence[int] = (0, 3, 5)) -> str:
    """Return the rules for any command that this one broke, in a sentence; empty if none."""
    return "; ".join(done.wrong(codes))


def wrong(ends: Sequence[Ended], here: Path, most: int) -> str:
    """Return what is wrong after a race in which `most` processes may succeed; empty if nothing."""
    well = sum(done.code in (0, 5) for done in ends)
    captures = [*here.rglob("capture*.mcap"), *here.glob("record*.mcap")]
    if odd := "; ".join(filter(None, map(odd_end, ends))):
        return odd
    if well > most or (captures and well != len(captures)):
        return f"{well} ended well where {most} may, and {len(captures)} captures are there"
    for capture in captures:
        try:
            recording = load(capture)
        except MpucalError as error:
            return f"capture: {error}"
        if recording.recovered:
            return f"capture: {recording.recovered}"
        beside = capture.parent / "calibration.json"
        if beside.exists() and Calibration.load(beside).fit["recording_digest"] != recording_digest(recording):
            return "the results beside a capture are another's"
    return "" if well else "none ended well"


def races(numbers: Iterable[int], of: int, draw: random.Random, tell: Tell) -> None:
    """Run races of `of` processes, which begin at nearly the same time."""
    for _ in numbers:
        seeds = [draw.randrange(1 << 20) for _ in range(of)]
        named = [(*SESSION, "--bus", f"sim:seed={seed}") for seed in seeds]
        for what, words, most in (
            ("sessions, one -o", [(*each, "-o", "board") for each in named], 1),
            ("sessions, no -o", named, of),
            ("recordings, one -o", [(*RECORD, "--bus", f"sim:seed={s}", "-o", "record.mcap") for s in seeds], 1),
        ):
            with folder() as here:
                children = [begin(each, here, number) for number, each in enumerate(words)]
                for child in children:
                    child.go()
                    time.sleep(draw.choice((0.0, draw.uniform(0.0, APART_S))))
                tell(f"{of} {what}", wrong([child.wait(ENDS_S) for child in children], here, most))


def meddle(numbers: Iterable[int], draw: random.Random, tell: Tell) -> None:
    """Run sessions whose files another program changes."""
    for number in numbers:
        kind = ("rename", "cut", "remove", "replace", "swap")[number % 5]
        with folder() as here:
            child = begin((*SESSION, "--bus", f"sim:seed={draw.randrange(1 << 20)}", "-o", "board"), here).go()
            capture = here / "board" / "capture.mcap"
            while not capture.exists():
                time.sleep(0.001)
            time.sleep(draw.uniform(0.0, 0.2))
            with suppress(FileNotFoundError):
                _meddle(kind, capture)
            tell(f"meddled: {kind}", _after_meddling(kind, child.wait(ENDS_S), here))


def _meddle(kind: str, capture: Path) -> None:
    if kind in ("rename", "swap"):
        capture.parent.rename(capture.parents[1] / "seven")
        if kind == "swap":
            capture.parent.mkdir()
    elif kind == "cut":
        os.truncate(capture, capture.stat().st_size // 2)
    else:
        capture.unlink()
        if kind == "replace":
            capture.write_bytes(b"another")


def _after_meddling(kind: str, done: Ended, here: Path) -> str:
    if odd := odd_end(done):
        return odd
    where = here / ("seven" if kind in ("rename", "swap") else "board")
    try:
        whole = load(where / "capture.mcap").recovered is None
    except MpucalError:
        whole = False
    if done.code == 3:
        return "" if "by another program" in done.said else done.last
    return "" if whole and (where / "calibration.json").exists() else f"exit code {done.code}, and no whole capture"


def end(numbers: Iterable[int], draw: random.Random, tell: Tell) -> None:
    """Run commands that start processes, and end each by a signal."""
    for number in numbers:
        kind = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)[number // 2 % 4]
        what, words = (
            # a session with a page outlives its terminal
            ("session", (*SESSION, "--bus", "sim:pace=real", *(["--page"] if kind != signal.SIGHUP else []))),
            ("batch", ("batch", str(RECORDED), "-o", "fleet", "--workers", "2")),
        )[number % 2]
        with TemporaryDirectory(ignore_cleanup_errors=True) as place, Path(os.devnull).open("r+") as null:
            command = [sys.executable, "-m", "mpucal", *words]
            process = subprocess.Popen(command, cwd=place, stdin=null, stdout=null, stderr=null, start_new_session=True)
            time.sleep(draw.uniform(0.2, LONGEST_START_S))
            process.send_signal(kind)
            until_s = time.monotonic() + LEFT_S
            while (process.poll() is None or _of_session(process.pid)) and time.monotonic() < until_s:
                time.sleep(0.1)
            left = _of_session(process.pid)
            for each in left:
                with suppress(ProcessLookupError):
                    os.kill(each, signal.SIGKILL)
            process.wait()
            tell(f"{kind.name} to {what}", f"{len(left)} processes are left" if left else "")


def _of_session(leader: int) -> list[int]:
    """Return the ids of the processes in the session of `leader` that still run, by proc(5)."""
    found = []
    for stat_file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = stat_file.read_text().rpartition(")")[2].split()
            if int(words[3]) == leader and words[0] != "Z":
                found.append(int(stat_file.parent.name))
    return found


def main() -> int:
    """Run the trials; return 1 if something was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("--pairs", 10), ("--eights", 2), ("--meddled", 10), ("--ended", 0), ("--seed", 1)):
        parser.add_argument(name, type=int, default=default)
    parser.add_argument("--seconds", type=float, default=3600.0, help="begin none of a kind after these")
    asked = parser.parse_args()
    draw, told = random.Random(asked.seed), dict[str, list[str]]()

    def tell(kind: str, what: str) -> None:
        told.setdefault(kind, []).append(what)

    def numbers(count: int) -> Iterator[int]:
        until_s = time.monotonic() + asked.seconds
        return takewhile(lambda _: time.monotonic() < until_s, range(count))

    ready()
    races(numbers(asked.pairs), 2, draw, tell)
    races(numbers(asked.eights), 8, draw, tell)
    meddle(numbers(asked.meddled), draw, tell)
    end(numbers(asked.ended), draw, tell)
    bad = {kind: list(filter(None, of)) for kind, of in told.items()}
    for kind, of in told.items():
        print(
            f"{kind:32} {len(of):5} {f'{len(bad[kind])} wrong: {bad[kind][0]}' if bad[kind] else 'as they ought to be'}"
        )
    return int(any(bad.values()))
