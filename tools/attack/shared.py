"""Run processes that share a folder or a file name, and end some by signals.

    python -m tools.attack shared --pairs 40 --eights 10 --ended 8

A race forks several processes, which begin together: sessions and recordings of a simulated chip with the same -o, or
without -o. At most one process may succeed for each capture that is there, each capture must be whole and the results
beside it its own, and all other processes must end with a sentence. Ending sends KILL, TERM, HUP or ALRM to a batch and
to a session at any time, and none of its processes may be left after ten seconds. Exit code 1: a rule was broken.
"""

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

import psutil

from mpucal.__main__ import run
from mpucal.calibration import recording_digest
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from tools.lab.runner import Trial
from tools.lab.table import Column, Row, count, frequencies
from tools.processes import Child, Ended, ready

SESSION = ("session", "--rate", "25", "--target", "quick", "--yes", "--no-write")
RECORD = ("record", "--seconds", "2")
RECORDED = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
ENDS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)
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


def race(of: int, draw: random.Random) -> list[Row]:
    """Run races of `of` processes, which begin at nearly the same time."""
    ready()
    seeds = [draw.randrange(1 << 20) for _ in range(of)]
    named = [(*SESSION, "--bus", f"sim:seed={seed}") for seed in seeds]
    rows = []
    for what, words, most in (
        ("sessions, one -o", [(*each, "-o", "board") for each in named], 1),
        ("sessions, no -o", named, of),
        ("recordings, one -o", [(*RECORD, "--bus", f"sim:seed={s}", "-o", "record.mcap") for s in seeds], 1),
    ):
        with TemporaryDirectory() as place:
            (here := Path(place) / "here").mkdir()
            said = [Path(place) / f"said-{number}" for number in range(of)]
            children = [Child(partial(run, list(each)), here, file) for each, file in zip(words, said, strict=True)]
            for child in children:
                child.go()
                time.sleep(draw.choice((0.0, draw.uniform(0.0, APART_S))))
            ends = [child.wait(ENDS_S) for child in children]
            rows.append(Row(name=f"{of} {what}", wrong=wrong(ends, here, most)))
    return rows


def end(number: int, draw: random.Random) -> Row:
    """Run a command that starts processes, and end it by a signal."""
    kind = ENDS[number // 2 % 4]
    what, words = (
        # a session with a page outlives its terminal
        ("session", (*SESSION, "--bus", "sim:pace=real", *(["--page"] if kind != signal.SIGHUP else []))),
        ("batch", ("batch", str(RECORDED), "-o", "fleet", "--workers", "2")),
    )[number % 2]
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        null, command = subprocess.DEVNULL, [sys.executable, "-m", "mpucal", *words]
        process = subprocess.Popen(command, cwd=place, stdin=null, stdout=null, stderr=null, start_new_session=True)
        time.sleep(draw.uniform(0.2, LONGEST_START_S))
        process.send_signal(kind)
        until_s = time.monotonic() + LEFT_S
        while (process.poll() is None or of_session(process.pid)) and time.monotonic() < until_s:
            time.sleep(0.1)
        for each in (left := of_session(process.pid)):
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.wait()
    return Row(name=f"{kind.name} to {what}", wrong=f"{len(left)} processes are left" if left else "")


def of_session(leader: int) -> list[psutil.Process]:
    """Return the processes in the session of `leader` that still run."""
    found = []
    for each in psutil.process_iter():
        with suppress(ProcessLookupError, psutil.NoSuchProcess):
            if os.getsid(each.pid) == leader and each.status() != psutil.STATUS_ZOMBIE:
                found.append(each)
    return found


def of_item(item: tuple[int, int]) -> list[Row] | Row:
    """Run races of so many processes, or end a command if they are none, as the number draws."""
    of, number = item
    draw = random.Random(f"{of} {number}")
    return race(of, draw) if of else end(number, draw)


def scenarios(
    *,
    pairs: Annotated[int, "races of two"] = 10,
    eights: Annotated[int, "races of eight"] = 2,
    ended: Annotated[int, "commands that a signal ends"] = 0,
    first: int = 0,
) -> list[tuple[int, int]]:
    """Return how many processes each race has, and its number."""
    return [(of, first + k) for of, times in ((2, pairs), (8, eights), (0, ended)) for k in range(times)]


COLUMNS: dict[str, Column] = {
    "all": len,
    "wrong": count("wrong"),
    "what": lambda rows: frequencies(row.wrong for row in rows if row.wrong),
}
main = Trial(__doc__, of_item, scenarios, COLUMNS)
