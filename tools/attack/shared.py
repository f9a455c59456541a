"""Processes that share a folder or a name, others that meddle with their files, and every output where no file is.

    .venv/bin/python -m tools.attack shared [--pairs N] [--eights N] [--meddled N] [--ended N] [--outputs]
                                           [--seed N] [--seconds S]

A race forks so many processes, which begin together: sessions and recordings of a simulated chip into one -o, and into
none. Meddling renames a session's folder, or cuts, removes or replaces its capture. Ending sends KILL, TERM, HUP or
ALRM to a batch and to a session at any time, and counts the processes that are left of it after ten seconds. An output
is a device, a pipe, a link or a folder in the place of the file. It is judged whether one process at most ends well
for each capture that is there, whether each capture is whole and the results beside it are its own, and whether all
others end with a sentence. Exit code 1: what is said last was not so.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mpucal import __main__ as program
from mpucal.calibration.recording_digest import recording_digest
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.calibration import Calibration

SESSION = ("session", "--rate", "25", "--target", "quick", "--yes", "--no-write")
RECORD = ("record", "--seconds", "2")
# starts lie apart by up to this [s]
APART_S = 0.02
ENDS_S = 60.0
# the time in which a command has all its processes, and that after which none may be left [s]
LONGEST_START_S, LEFT_S = 4.0, 10.0


class Process:
    """A command in a process of its own, which waits until it is let go."""

    def __init__(self, words: Sequence[str], folder: Path, number: int) -> None:
        self.said = folder.parent / f"said-{folder.name}-{number}"
        hold, self._go = os.pipe()
        self._process = os.fork()
        if self._process == 0:
            os.close(self._go)
            os.read(hold, 1)
            become(words, folder, self.said)
        os.close(hold)

    def go(self) -> None:
        """Let it begin; another process forked since holds the pipe open, too."""
        os.write(self._go, b"!")
        os.close(self._go)

    def wait(self) -> tuple[int, str]:
        """Its exit code, and what it said."""
        until_s = time.monotonic() + ENDS_S
        while time.monotonic() < until_s:
            ended, status = os.waitpid(self._process, os.WNOHANG)
            if ended:
                return os.waitstatus_to_exitcode(status), self.said.read_text(errors="replace")
            time.sleep(0.002)
        os.kill(self._process, 9)
        os.waitpid(self._process, 0)
        return -1, "it hung"


def become(words: Sequence[str], folder: Path, said: Path) -> None:
    """A command in this process, within `folder`, that says all to the file `said`; ends it."""
    os.chdir(folder)
    nothing, out = os.open(os.devnull, os.O_RDONLY), os.open(said, os.O_WRONLY | os.O_CREAT, 0o600)
    for number, handle in enumerate((nothing, out, out)):
        os.dup2(handle, number)
    sys.stdin, sys.stdout, sys.stderr = os.fdopen(0), os.fdopen(1, "w"), os.fdopen(2, "w")
    code = 1
    with suppress(BaseException):
        code = program.run(list(words))
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def race(words: Sequence[Sequence[str]], folder: Path, draw: random.Random) -> list[tuple[int, str]]:
    """How those end that begin together, or nearly so."""
    processes = [Process(each, folder, number) for number, each in enumerate(words)]
    for process in processes:
        process.go()
        time.sleep(draw.choice((0.0, draw.uniform(0.0, APART_S))))
    return [process.wait() for process in processes]


def wrong(ended: Sequence[tuple[int, str]], folder: Path, most: int) -> str:
    """What is not as it ought to be; empty where all is."""
    well = sum(code in (0, 5) for code, _ in ended)
    captures = [*folder.rglob("capture*.mcap"), *folder.glob("record*.mcap")]
    odd = [said for code, said in ended if code not in (0, 3, 5) or "Traceback" in said]
    if odd:
        return f"odd end: {odd[0][-300:]}"
    if well > most:
        return f"{well} ended well where {most} may"
    if well != len(captures) and captures:
        return f"{well} ended well, and {len(captures)} captures are there"
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


def races(numbers: Iterable[int], of: int, draw: random.Random, tell: Callable[[str, str], None]) -> None:
    """So many races of so many processes."""
    for _ in numbers:
        seeds = [draw.randrange(1 << 20) for _ in range(of)]
        named = [(*SESSION, "--bus", f"sim:seed={seed}") for seed in seeds]
        for what, words, most in (
            ("sessions, one -o", [(*each, "-o", "board") for each in named], 1),
            ("sessions, no -o", named, of),
            ("recordings, one -o", [(*RECORD, "--bus", f"sim:seed={s}", "-o", "record.mcap") for s in seeds], 1),
        ):
            with TemporaryDirectory() as place:
                (folder := Path(place) / "here").mkdir()
                tell(f"{of} {what}", wrong(race(words, folder, draw), folder, most))


def meddle(numbers: Iterable[int], draw: random.Random, tell: Callable[[str, str], None]) -> None:
    """So many sessions whose files another program touches."""
    for number in numbers:
        kind = ("rename", "cut", "remove", "replace", "swap")[number % 5]
        with TemporaryDirectory() as place:
            (folder := Path(place) / "here").mkdir()
            words = (*SESSION, "--bus", f"sim:seed={draw.randrange(1 << 20)}", "-o", "board")
            process = Process(words, folder, 0)
            process.go()
            capture = folder / "board" / "capture.mcap"
            while not capture.exists():
                time.sleep(0.001)
            time.sleep(draw.uniform(0.0, 0.2))
            with suppress(FileNotFoundError):
                _meddle(kind, capture)
            code, said = process.wait()
            tell(f"meddled: {kind}", _after_meddling(kind, code, said, folder))


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


def _after_meddling(kind: str, code: int, said: str, folder: Path) -> str:
    if "Traceback" in said:
        return said[-300:]
    where = folder / ("seven" if kind in ("rename", "swap") else "board")
    try:
        whole = load(where / "capture.mcap").recovered is None
    except MpucalError:
        whole = False
    if code in (0, 5):
        return "" if whole and (where / "calibration.json").exists() else f"exit code {code}, and no whole capture"
    return "" if code == 3 and "by another program" in said else f"exit code {code}: {said[-200:]}"


def end(numbers: Iterable[int], draw: random.Random, tell: Callable[[str, str], None]) -> None:
    """So many commands with processes of their own, ended by a signal."""
    capture = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
    for number in numbers:
        kind = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)[number // 2 % 4]
        what, words = (
            # one with a page outlives its terminal
            ("session", (*SESSION, "--bus", "sim:pace=real", *(["--page"] if kind != signal.SIGHUP else []))),
            ("batch", ("batch", str(capture), "-o", "fleet", "--workers", "2")),
        )[number % 2]
        with TemporaryDirectory(ignore_cleanup_errors=True) as place:
            process = subprocess.Popen(
                [sys.executable, "-m", "mpucal", *words],
                cwd=place,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
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


def _until(count: int, seconds: float) -> Iterator[int]:
    """So many numbers, or as many as there is time for."""
    until_s = time.monotonic() + seconds
    return takewhile(lambda _: time.monotonic() < until_s, range(count))


def _of_session(leader: int) -> list[int]:
    """The processes that are left of those that `leader` began, by proc(5)."""
    found = []
    for stat_file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = stat_file.read_text().rpartition(")")[2].split()
            if int(words[3]) == leader and words[0] != "Z":
                found.append(int(stat_file.parent.name))
    return found


def outputs(tell: Callable[[str, str], None]) -> None:
    """Each command that writes, where its output is no file."""
    with TemporaryDirectory() as made:
        base = Path(made)
        (here := base / "here").mkdir()
        Process((*SESSION, "--bus", "sim:seed=1", "-o", "a"), here, 0).go()
        while not (here / "a" / "report.html").exists():
            time.sleep(0.05)
        a = here / "a"
        np.savez(here / "walk.npz", t=np.arange(9) / 9, acc=np.full((9, 3), 9.0), gyr=np.zeros((9, 3)))
        calibration = str(a / "calibration.json")
        files = {
            "export": ("export", calibration, "--to", "json", "-o", "{}"),
            **{
                f"apply {ending}": ("apply", calibration, "walk.npz", "-o", f"{{}}{ending}")
                for ending in (".csv", ".npz", ".mcap")
            },
            "record": (*RECORD, "--bus", "sim:seed=1", "-o", "{}.mcap"),
            "stream": ("stream", "--bus", "sim", "--apply", calibration, "--seconds", "1", "-o", "{}.mcap"),
        }
        folders = {
            "calibrate": (("calibrate", str(a), "-o", "{}"), "calibration.json"),
            "noise": (("noise", str(a / "capture.mcap"), "-o", "{}"), "noise.json"),
            "check": (("check", calibration, str(a), "-o", "{}"), "check.json"),
            "session": ((*SESSION, "--bus", "sim:seed=1", "-o", "{}"), "capture.mcap"),
        }
        for kind, make in OBSTACLES.items():
            for name, words in files.items():
                ending = words[-1].removeprefix("{}")
                with TemporaryDirectory(dir=base) as place:
                    tell(f"{kind}: {name}", _obstructed(words, here, Path(place) / f"out{ending}", "out", make))
            for name, (words, held) in folders.items():
                with TemporaryDirectory(dir=base) as place:
                    (Path(place) / "out").mkdir()
                    tell(f"{kind}: {name}", _obstructed(words, here, Path(place) / "out" / held, "out", make))


def _obstructed(words: Sequence[str], here: Path, path: Path, stem: str, make: Callable[[Path], None]) -> str:
    try:
        make(path)
    except PermissionError:
        return ""
    was, target = path.lstat(), path.parent / "target"
    out = path.parents[1] / stem if path.parent.name == stem else path.parent / stem
    process = Process([word.format(out) for word in words], here, 1)
    process.go()
    code, said = process.wait()
    if not os.path.samestat(path.lstat(), was) or (target.exists() and target.read_bytes() != b"old"):
        return "what was there was replaced"
    return "" if code in (2, 3) and "Traceback" not in said else f"exit code {code}: {said[-200:]}"


def _link(path: Path) -> None:
    (path.parent / "target").write_bytes(b"old")
    path.symlink_to("target")


OBSTACLES: dict[str, Callable[[Path], None]] = {
    "device": lambda path: os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3)),
    "pipe": os.mkfifo,
    "link": _link,
    "link to nothing": lambda path: path.symlink_to("nothing"),
    "folder": Path.mkdir,
}


def main() -> int:
    """Run what was asked for; 1 where something was not as it ought to be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for name, default in (("--pairs", 10), ("--eights", 2), ("--meddled", 10), ("--ended", 0), ("--seed", 1)):
        parser.add_argument(name, type=int, default=default)
    parser.add_argument("--outputs", action="store_true")
    parser.add_argument("--seconds", type=float, default=3600.0, help="begin none of a kind after these")
    asked = parser.parse_args()
    draw = random.Random(asked.seed)
    counts: dict[str, tuple[int, int]] = {}
    first: dict[str, str] = {}

    def tell(kind: str, what: str) -> None:
        done, bad = counts.get(kind, (0, 0))
        counts[kind] = done + 1, bad + bool(what)
        if what:
            first.setdefault(kind, what)

    # forked processes find it loaded
    from mpucal.cli import calibrate, record, session  # noqa: F401, PLC0415

    races(_until(asked.pairs, asked.seconds), 2, draw, tell)
    races(_until(asked.eights, asked.seconds), 8, draw, tell)
    meddle(_until(asked.meddled, asked.seconds), draw, tell)
    end(_until(asked.ended, asked.seconds), draw, tell)
    if asked.outputs:
        outputs(tell)
    for kind, (done, bad) in counts.items():
        print(f"{kind:32} {done:5} {f'{bad} wrong: {first[kind]}' if bad else 'as they ought to be'}")
    return int(bool(first))
