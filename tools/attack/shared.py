"""Run processes that share a folder or a file name, and end some by signals.

    python -m tools.attack shared --pairs 40 --eights 10 --ended 8

A race forks so many processes, which begin together: sessions and recordings of a simulated chip into one -o, and into
none. Ending sends KILL, TERM, HUP or ALRM to a batch and to a session at any time, and counts the processes that are
left of it after ten seconds. It is judged whether one process at most ends well for each capture that is there, whether
each capture is whole and the results beside it are its own, and whether all others end with a sentence. Exit code 1:
what is said last was not so.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from mpucal.__main__ import run
from mpucal.calibration import recording_digest
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from tools.processes import Child, Ended, Report, ready

SESSION = ("session", "--rate", "25", "--target", "quick", "--yes", "--no-write")
RECORD = ("record", "--seconds", "2")
RECORDED = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
# largest time between two starts [s]
APART_S = 0.02
# A process that waits for others on a busy computer does not hang; one that computes ends by its processor time.
ENDS_S = 900.0
# time in which a command starts all its processes, and time after which none may be left [s]
LONGEST_START_S, LEFT_S = 4.0, 10.0


def wrong(ends: Sequence[Ended], here: Path, most: int) -> str:
    """Return what is wrong after a race in which `most` processes may succeed; empty if nothing."""
    well = sum(done.code in (0, 5) for done in ends)
    captures = [*here.rglob("capture*.mcap"), *here.glob("record*.mcap")]
    if odd := [each for done in ends for each in done.wrong((0, 3, 5))]:
        return "; ".join(odd)
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


def race(of: int, draw: random.Random, report: Report) -> None:
    """Run races of `of` processes, which begin at nearly the same time."""
    seeds = [draw.randrange(1 << 20) for _ in range(of)]
    named = [(*SESSION, "--bus", f"sim:seed={seed}") for seed in seeds]
    for what, words, most in (
        ("sessions, one -o", [(*each, "-o", "board") for each in named], 1),
        ("sessions, no -o", named, of),
        ("recordings, one -o", [(*RECORD, "--bus", f"sim:seed={s}", "-o", "record.mcap") for s in seeds], 1),
    ):
        with TemporaryDirectory() as place:
            (here := Path(place) / "here").mkdir()
            children = [
                Child(partial(run, list(each)), here, Path(place) / f"said-{number}")
                for number, each in enumerate(words)
            ]
            for child in children:
                child.go()
                time.sleep(draw.choice((0.0, draw.uniform(0.0, APART_S))))
            report.tell(f"{of} {what}", wrong([child.wait(ENDS_S) for child in children], here, most))


def end(number: int, draw: random.Random, report: Report) -> None:
    """Run a command that starts processes, and end it by a signal."""
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
        report.tell(f"{kind.name} to {what}", f"{len(left)} processes are left" if left else "")


def _of_session(leader: int) -> list[int]:
    """Return the ids of the processes in the session of `leader` that still run, by proc(5)."""
    found = []
    for stat_file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = stat_file.read_text().rpartition(")")[2].split()
            if int(words[3]) == leader and words[0] != "Z":
                found.append(int(stat_file.parent.name))
    return found


def main(
    *,
    pairs: Annotated[int, "races of two"] = 10,
    eights: Annotated[int, "races of eight"] = 2,
    ended: Annotated[int, "commands that a signal ends"] = 0,
    seed: int = 1,
) -> int:
    """Run the trials; return 1 if something was wrong."""
    draw, report = random.Random(seed), Report()
    ready()
    for of, count in ((2, pairs), (8, eights)):
        for _ in range(count):
            race(of, draw, report)
    for number in range(ended):
        end(number, draw, report)
    return report.shown()
