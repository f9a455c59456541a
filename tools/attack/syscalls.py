"""Fail each system call of a command in turn, then its allocations, and cut the power: is each file the old or the new?

    python -m tools.attack syscalls [COMMAND ...] [--each] [--most N] [--allocations N] [--seed N]

syscalls.c is preloaded: it counts what a command asks of the files below a folder (open, read, write, fsync,
close, rename, unlink, mkdir, chmod, stat, opendir, mmap). The command runs again and again, and each time one of its
calls fails, with an error that such a call may have. Calls that repeat (the same call, of the same file) are a kind:
its first, second, middle and last are failed; with --each, every one; with --most, at most N of these. Then one
allocation of 4 kB or more gets no memory, or all from one on do not: the first and the last, and so many drawn by the
seed. Sessions are quick ones. Wrong is: a traceback or a crash, an undocumented exit code, a failure without a
sentence, a file that is neither the whole old one nor the whole new one, a recording that is gone, a device whose
content has changed while nothing says so. Crashes of NumPy, some of whose loops use a buffer that they did not get,
are counted.

Its calls are also replayed into a model of a disk (disk_model.py), and the power is cut after calls of each
kind: each file must be old or new, what was synced be there, and a note of a write as long as its device is between.
Seeds are the day's number. Exit code 1 where something was wrong.
"""

import errno
import json
import os
import random
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated

from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.blob import Blob
from tools.lab.runner import Trial
from tools.lab.table import Column, Row, count, frequencies
from tools.processes import ready

from .disk_model import Call, Disk, logged
from .fuzz import ROOT, TODAY
from .syscalls_commands import STATE, WORDS, Failed, Failing, prepared, run_failing

Each = Annotated[bool, "fail every call, and cut the power after each"]
Most = Annotated[int | None, "fail so many calls of a command at most, drawn by the seed"]
More = Annotated[int, "fail so many, too"]
SHIM = Path(__file__).with_suffix(".c")
DISK = (errno.EIO, errno.ENOSPC, errno.EDQUOT)
REFUSED = (errno.EROFS, errno.EACCES)
ERRORS = {
    "o": (*DISK, *REFUSED, errno.EMFILE, errno.EINTR),
    "i": (errno.EIO, errno.EINTR),
    "w": (*DISK, errno.EFBIG, errno.EINTR),
    "s": DISK,
    "c": DISK,
    "r": (*DISK, *REFUSED),
    "u": (errno.EIO, *REFUSED),
    "m": (*DISK, *REFUSED),
    "p": (errno.EIO, *REFUSED),
    "l": (errno.EIO, errno.EACCES),
    "a": (errno.ENOMEM, errno.EACCES),
}
# times in files, which differ between runs; a check counts the age of a calibration
DATE = re.compile(
    rb'"digest": "[\w:]+"|(?<=[.]\d{4})\d+|'
    rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?([.]\d+)?([+-]\d\d:\d\d|Z| UTC)?"
)
TEMPORARY = re.compile(r"(^|/)[.](.+)[.]\w{8}$")
CAPTURES = (".mcap",)
COPY = "bridge/"
# library with loops that use a buffer although its allocation failed
NUMPY = "_multiarray_umath"
DRAWS, LEAST_BYTES = 3, 4096
Files = Mapping[str, bytes]
Whole = Callable[[str, bytes], bool]


def files(folder: Path) -> dict[str, bytes]:
    """Return the content of each file below, by name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def is_old_or_new(old: Files, new: Files, placed: Mapping[str, Sequence[bytes]]) -> Whole:
    """Return a test of a file: True if it is as before, or as the command writes it, at first or after a write-back.

    Temporary files and notes of writes do not count.
    """

    def whole(name: str, data: bytes) -> bool:
        if data == old.get(name) or Path(name).name.startswith(".") or name.startswith(STATE):
            return True
        if name not in new:
            return False
        if name.startswith(COPY):
            # a copy of a file of mpucal can be made again
            return True
        if name.endswith(CAPTURES):
            # an unfinished capture is read as far as possible, or refused with a sentence
            return True
        if name.endswith(".html"):
            # a report contains the time
            return data.rstrip().endswith(b"</html>")
        if name.endswith(".bin"):
            return bool(Blob.decode(data))
        return DATE.sub(b"", data) in (DATE.sub(b"", each) for each in (new[name], *placed.get(name, ())))

    return whole


def damaged_files(found: Files, whole: Whole) -> Iterator[str]:
    """Yield the names of the files that are neither old nor new."""
    for name, data in found.items():
        try:
            fit = whole(name, data)
        except (MpucalError, ValueError):
            fit = False
        if not fit:
            yield name


def has_write_note(found: Files) -> bool:
    """Return True if there is a readable note of a write."""
    return any(
        "old" in (said := json.loads(data)) or "registers" in said
        for name, data in found.items()
        if name.startswith(STATE) and not Path(name).name.startswith(".")
    )


class Command:
    """Trial of a command on copies of the folder `start`."""

    def __init__(self, name: str, start: Path) -> None:
        self._words, self._start, self._here = WORDS[name], start, start.parent / f"of {name}" / "here"
        self._anew()
        self.old = files(self._here)
        with self._here.with_name("log").open("w+b", buffering=0) as log:
            done = run_failing(self._words, self._here, Failing(least=LEAST_BYTES, log=log.fileno()))
            log.seek(0)
            self.log = list(logged(log.read(), str(self._here)))
        assert done.code == 0, done.said
        self.new, self.allocations = files(self._here), done.allocations
        self.calls = [call for call in self.log if call.op != "d"]
        disk = Disk(self.old)
        for call in self.calls:
            disk.call(call)
        self.whole = is_old_or_new(self.old, self.new, disk.placed)

    def failed(self, failing: Failing) -> tuple[str, list[str]]:
        """Run the command with this failure; return its exit in words, and what was wrong."""
        self._anew()
        done = run_failing(self._words, self._here, failing)
        if (done.crashed or "").startswith(NUMPY):
            return "NumPy crashed", []
        return f"exit {done.code}", list(self._wrong(done, files(self._here), failing.call))

    def _wrong(self, done: Failed, now: Files, call: int) -> Iterator[str]:
        yield from (f"{each} {done.crashed or ''}" for each in done.wrong())
        # an old report beside a new calibration would be wrong
        yield from (f"{name} is gone" for name in self.old.keys() - now.keys() if not name.endswith("report.html"))
        yield from (f"{name} is neither old nor new" for name in damaged_files(now, self.whole))
        if done.code == 0:
            yield from (f"exit 0 without {name}" for name in self.new.keys() - now.keys())
        told = has_write_note(now) or "restore the old state" in done.last
        if told != (done.changed and done.code != 0):
            yield f"exit {done.code}, device {'changed' if done.changed else 'as before'}, told: {told}"
        for name in (name for name in self.new.keys() - self.old.keys() if name.endswith(CAPTURES)):
            written = [i for i, each in enumerate(self.calls, 1) if each.op == "w" and each.path == name]
            # the first write is the header
            if name in now if done.code == 0 else written[1] < call:
                try:
                    load(self._here / name)
                except MpucalError as error:
                    yield f"exit {done.code}, and what was recorded is lost: {error}"

    def cut_off(self, rng: random.Random, looked: Sequence[int]) -> tuple[int, list[str]]:
        """Cut the power after these entries of the log, and return the number of cuts and what was wrong."""
        disk, wrong, cuts = Disk(self.old), [], 0
        states = [call.data for call in self.log if call.op == "d"]
        state = b""
        for i, call in enumerate(self.log):
            disk.call(call)
            state = call.data if call.op == "d" else state
            for share in (0.0, 1.0, *(rng.random() for _ in range(DRAWS))) if i in looked else ():
                left = disk.cut(rng, share)
                cuts += 1
                bad = [f"{name} is neither old nor new" for name in damaged_files(left, self.whole)]
                bad += [
                    f"{name} was synced, and is gone"
                    for name in disk.synced
                    if name.endswith(CAPTURES) and name not in left
                ]
                if state and state not in (states[0], states[-1]) and not has_write_note(left):
                    bad.append("the device is neither old nor new, and nothing says so")
                if i == len(self.log) - 1 and has_write_note(left):
                    bad.append("all is done, and the next write will undo it")
                wrong += [f"power cut after {i} ({call.op} {call.path}): {each}" for each in bad]
        return cuts, wrong

    def _anew(self) -> None:
        shutil.rmtree(self._here, ignore_errors=True)
        shutil.copytree(self._start, self._here)


def sampled(calls: Sequence[Call], each: bool) -> list[int]:
    """Return indices of calls: of each kind the first, second, middle and last; or all."""
    kinds = defaultdict(list)
    for i, call in enumerate(calls):
        kinds[call.op, TEMPORARY.sub(r"\1\2~", call.path)].append(i)
    some = ({of[0], of[min(1, len(of) - 1)], of[len(of) // 2], of[-1]} for of in kinds.values())
    return list(range(len(calls))) if each else sorted(set().union(*some))


def of_command(
    item: tuple[str, Path, int], *, each: Each = False, most: Most = None, allocations: More = 0
) -> list[Row]:
    """Try a command: a row for each call, allocation and cut of the power."""
    ready()
    name, start, seed = item
    rng = random.Random(f"{name} {seed}")
    command, rows = Command(name, start), []
    failures = []
    for i in sampled(command.calls, each):
        call = command.calls[i]
        failing = Failing(i + 1, rng.choice(ERRORS[call.op]))
        failures.append((f"call {i + 1} ({call.op} {call.path}) {errno.errorcode[failing.error]}", failing))
    failures = rng.sample(failures, min(most or len(failures), len(failures)))
    of = command.allocations
    drawn = sorted({1, of, *(rng.randint(1, of) for _ in range(allocations))}) if allocations else ()
    for n, since in product(drawn, (False, True)):
        failing = Failing(least=LEAST_BYTES, allocation=n, since=since)
        failures.append((f"allocation {n}{' on' if since else ''}", failing))
    for what, failing in failures:
        end, wrong = command.failed(failing)
        kind, calls = what.partition(" ")[0], len(command.calls)
        rows.append(
            Row(command=f"{name}, {calls} calls", kind=kind, end=end, wrong=[f"{what}: {bad}" for bad in wrong])
        )
    cuts, wrong = command.cut_off(rng, [*sampled(command.log, each), len(command.log) - 1])
    return [*rows, Row(command=f"{name}, {len(command.calls)} calls", kind="power", end=f"{cuts} cuts", wrong=wrong)]


def scenarios(
    commands: Annotated[Sequence[str], WORDS, "default: all"] = tuple(WORDS), *, seed: int = TODAY
) -> list[tuple[str, Path, int]]:
    """Return the commands, with a folder of their inputs; start this program again, if need be, with syscalls.c."""
    if "LD_PRELOAD" not in os.environ:
        library = ROOT / "build" / "syscalls.so"
        library.parent.mkdir(exist_ok=True)
        subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, SHIM, "-ldl"], check=True)
        os.execve(sys.executable, sys.orig_argv, {**os.environ, "LD_PRELOAD": str(library)})
    print(f"seed {seed}", flush=True)
    start = prepared()
    return [(name, start, seed) for name in commands]


COLUMNS: dict[str, Column] = {
    "failed": len,
    "ends": lambda rows: frequencies(row.end for row in rows),
    "wrong": count("wrong"),
}


main = Trial(__doc__, of_command, scenarios, COLUMNS, ("command", "kind"))
