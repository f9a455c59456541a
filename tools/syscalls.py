"""Fail every system call of a command in turn, and cut the power after each: is the old file there, or the new one?

    python tools/syscalls.py [COMMAND ...] [--every N] [--errno EIO]

tools/syscalls.c is preloaded: it counts open, write, fsync, fdatasync, close, rename, unlink, mkdir and mmap of what
lies below the folder. For each the command runs again, and that call fails: it must end with a documented
exit code and a sentence, and each file be the old one or the new one, whole.

Then its calls are replayed into a model of a disk, on which what was not synced is lost, in part or whole, and renames
and new names of a folder that was not synced come in any order. After each call, each file must again be old or new.
Exit code 1 where one was not.
"""

from __future__ import annotations

import argparse
import ctypes
import errno
import os
import random
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from mpucal.__main__ import _keep_streams, run
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.result.blob import Blob

SHIM = Path(__file__).with_suffix(".c")
CODES = (0, 3, 4, 5, 6)
SIM = "sim:seed=3,chip=mpu6500,temperature_c="
WORDS = {
    "session": ["session", "--bus", f"{SIM}20", "--rate", "25", "-o", "new", "--yes"],
    "record": ["record", "--bus", f"{SIM}20", "--seconds", "3", "-o", "board/walk.mcap"],
    "calibrate": ["calibrate", "in.npz", "-o", "board"],
    "merge": ["merge", "a.json", "b.json", "-o", "board"],
    "check": ["check", "a.json", "in.mcap", "-o", "board"],
    "write": ["write", "a.json", "chip", "--bus", f"{SIM}20", "-o", "board", "--yes"],
    "export": ["export", "a.json", "--to", "c-header", "-o", "board/calibration.h"],
    "apply": ["apply", "a.json", "in.npz", "-o", "board/out.csv"],
}
# of files that are made anew with the time in them
DATE = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?([.]\d+)?([+-]\d\d:\d\d|Z| UTC)?")
CUTS, DRAWS = 60, 3
Whole = Callable[[str, bytes], bool]


def ended(
    words: Sequence[str], folder: Path, n: int = 0, error: int = errno.EIO, log: int = -1
) -> tuple[int, str, int]:
    """Exit code, what was said and how many calls counted, of a command whose call `n` fails."""
    shim = ctypes.CDLL(None)
    said = folder.parent / "said"
    hear, tell = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.chdir(folder)
        for handle in (1, 2):
            os.dup2(os.open(said if handle == 2 else "/dev/null", os.O_RDWR | os.O_CREAT | os.O_TRUNC), handle)
        _keep_streams()
        shim.syscalls_arm(str(folder).encode(), n, error, log)
        code = run(words)
        os.write(tell, str(shim.syscalls_count()).encode())
        os._exit(code)
    _, status = os.waitpid(pid, 0)
    os.close(tell)
    counted = os.read(hear, 20)
    os.close(hear)
    return os.waitstatus_to_exitcode(status), said.read_text("utf-8", "replace"), int(counted or 0)


def files(folder: Path) -> dict[str, bytes]:
    """Content by name, of what lies below."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def either(old: dict[str, bytes], new: dict[str, bytes]) -> Whole:
    """Whether a file is as before, or as the command makes it."""

    def whole(name: str, data: bytes) -> bool:
        if data == old.get(name):
            return True
        if name not in new:
            return False
        if name.endswith((".mcap", ".tlog")):
            return readable(name, data)
        if name.endswith(".html"):
            # it tells the minute
            return data.rstrip().endswith(b"</html>")
        if name.endswith(".bin"):
            return bool(Blob.decode(data))
        return DATE.sub(b"", data) == DATE.sub(b"", new[name])

    return whole


def readable(name: str, data: bytes) -> bool:
    """A capture is read as far as it goes, or refused in a sentence."""
    with TemporaryDirectory() as place:
        path = Path(place) / Path(name).name
        path.write_bytes(data)
        with suppress(MpucalError):
            load(path)
    return True


def prepared(place: Path) -> Path:
    """A folder with what the commands read, and an older result."""
    start = place / "start"
    start.mkdir()
    for name, celsius in (("a", "20"), ("b", "45,hand=placing")):
        folder = place / name
        assert ended(["session", "--bus", f"{SIM}{celsius}", "--rate", "25", "-o", str(folder), "--yes"], start)[0] == 0
        shutil.copy(folder / "calibration.json", start / f"{name}.json")
    shutil.copy(place / "a" / "capture.mcap", start / "in.mcap")
    with (start / "in.npz").open("wb") as file:
        import numpy as np  # noqa: PLC0415

        recording = load(start / "in.mcap")
        np.savez(file, t=recording.t, acc=recording.acc, gyr=recording.gyr)
    shutil.copytree(place / "b", start / "board", ignore=shutil.ignore_patterns("capture*"))
    return start


def failing(name: str, start: Path, every: int, error: int) -> tuple[int, Counter[int], list[str]]:
    """How many calls were failed, how the command ended, and what was wrong."""
    here = start.parent / "here"

    def anew() -> None:
        shutil.rmtree(here, ignore_errors=True)
        shutil.copytree(start, here)

    anew()
    old = files(here)
    code, said, count = ended(WORDS[name], here)
    whole = either(old, files(here))
    assert code == 0, said
    codes: Counter[int] = Counter()
    wrong = []
    for n in range(1 + random.randrange(every), count + 1, every):
        anew()
        code, said, _ = ended(WORDS[name], here, n, error)
        codes[code] += 1
        last = (said.strip().splitlines() or [""])[-1]
        if code not in CODES or "Traceback" in said or (code not in (0, 5) and not last.startswith("mpucal: ")):
            wrong.append(f"{name}: call {n} failed, exit {code}: {last}")
        now = files(here)
        # an old report beside a new calibration would be another's
        gone = [path for path in old.keys() - now.keys() if not path.endswith("report.html")]
        wrong += [f"{name}: call {n} failed, and {path} is gone" for path in gone]
        wrong += [f"{name}: call {n} failed, {path} is neither old nor new" for path in spoilt(now, whole)]
    return codes.total(), codes, wrong


def spoilt(found: dict[str, bytes], whole: Whole) -> Iterator[str]:
    """Those that are neither old nor new; a temporary file that could not be taken away is no result."""
    for name, data in found.items():
        try:
            fit = Path(name).name.startswith(".") or whole(name, data)
        except (MpucalError, ValueError):
            fit = False
        if not fit:
            yield name


@dataclass
class Inode:
    """A file: its content on the disk, and what was written since."""

    kept: bytes = b""
    since: list[tuple[int, bytes]] = field(default_factory=list)

    def after(self, writes: Sequence[tuple[int, bytes]]) -> bytes:
        """Its content with these writes alone."""
        data = bytearray(self.kept)
        for at, part in writes:
            data.extend(bytes(max(0, at + len(part) - len(data))))
            data[at : at + len(part)] = part
        return bytes(data)


class Disk:
    """Files by name as a power cut leaves them."""

    def __init__(self, content: dict[str, bytes]) -> None:
        self._names = {name: Inode(data) for name, data in content.items()}
        self._now = dict(self._names)
        # names that were set or taken away since their folder was synced
        self._since: list[tuple[str, Inode | None]] = []

    def call(self, op: str, flags: int, at: int, path: str, other: str, data: bytes) -> None:
        """One that was logged."""
        if op == "o" and flags & os.O_CREAT and (path not in self._now or flags & (os.O_TRUNC | os.O_EXCL)):
            self._set(path, Inode())
        elif op == "w" and path in self._now:
            self._now[path].since.append((at, data))
        elif op == "s" and path in self._now:
            inode = self._now[path]
            inode.kept, inode.since = inode.after(inode.since), []
        elif op == "s":
            for name, inode in self._since:
                self._settle(self._names, name, inode)
            self._since = []
        elif op == "r" and path in self._now:
            inode = self._now[path]
            self._set(path, None)
            self._set(other, inode)
        elif op == "u":
            self._set(path, None)

    def cut(self, rng: random.Random, share: float) -> dict[str, bytes]:
        """What is there after a cut that lets `share` of what was not synced reach the disk, in any order."""
        names = dict(self._names)
        for name, inode in rng.sample(self._since, len(self._since)):
            if rng.random() < share:
                self._settle(names, name, inode)
        return {
            name: inode.after([write for write in inode.since if rng.random() < share]) for name, inode in names.items()
        }

    def _set(self, name: str, inode: Inode | None) -> None:
        self._settle(self._now, name, inode)
        self._since.append((name, inode))

    @staticmethod
    def _settle(names: dict[str, Inode], name: str, inode: Inode | None) -> None:
        if inode is None:
            names.pop(name, None)
        else:
            names[name] = inode


def cut_off(name: str, start: Path) -> tuple[int, list[str]]:
    """How many cuts were looked at, and what was wrong."""
    here, rng = start.parent / "here", random.Random(1)
    shutil.rmtree(here, ignore_errors=True)
    shutil.copytree(start, here)
    old = files(here)
    with (start.parent / "log").open("w+b", buffering=0) as log:
        assert ended(WORDS[name], here, log=log.fileno())[0] == 0
        log.seek(0)
        calls = list(logged(log.read(), f"{here}/"))
    whole, disk, wrong, cuts = either(old, files(here)), Disk(old), [], 0
    looked = set(rng.sample(range(len(calls)), min(CUTS, len(calls)))) | {len(calls) - 1}
    for i, call in enumerate(calls):
        disk.call(*call)
        if i not in looked:
            continue
        for share in (0.0, 1.0, *(rng.random() for _ in range(DRAWS))):
            cuts += 1
            for path in spoilt(disk.cut(rng, share), whole):
                wrong.append(f"{name}: power cut after call {i} ({call[0]} {call[3]}): {path} is neither old nor new")
    return cuts, wrong


def logged(log: bytes, root: str) -> Iterator[tuple[str, int, int, str, str, bytes]]:
    """(op, flags, offset, path, other path, data) of each call."""
    while log:
        head, _, log = log.partition(b"\n")
        op, _, at, size, path, other = head.decode().split("\t")
        data, log = log[: int(size)], log[int(size) :]
        yield op, int(at), int(at), path.removeprefix(root), other.removeprefix(root), data


def main() -> int:
    """Run them; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=f"some of {', '.join(WORDS)}; default: all")
    parser.add_argument("--every", type=int, default=1, help="fail every N-th call alone")
    parser.add_argument("--errno", default="EIO")
    asked = parser.parse_args()
    if "LD_PRELOAD" not in os.environ:
        return preloaded()
    points, wrong = 0, []
    with TemporaryDirectory() as place:
        os.environ["XDG_STATE_HOME"] = f"{place}/state"
        start = prepared(Path(place).resolve())
        for name in asked.commands or WORDS:
            count, codes, bad = failing(name, start, asked.every, getattr(errno, asked.errno))
            cuts, worse = cut_off(name, start)
            points, wrong = points + count, [*wrong, *bad, *worse]
            ends = ", ".join(f"exit {code}: {n}" for code, n in sorted(codes.items()))
            print(
                f"{name:<10}{count:>5} calls failed ({ends}), {cuts} power cuts: {len(bad) + len(worse)} wrong",
                flush=True,
            )
    print("\n".join(wrong))
    print(f"{points} calls failed: {len(wrong)} wrong")
    return int(bool(wrong))


def preloaded() -> int:
    """The same with the shim."""
    with TemporaryDirectory() as place:
        library = Path(place) / "syscalls.so"
        subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, SHIM, "-ldl"], check=True)
        return subprocess.run(
            [sys.executable, *sys.argv], env={**os.environ, "LD_PRELOAD": str(library)}, check=False
        ).returncode


if __name__ == "__main__":
    sys.exit(main())
