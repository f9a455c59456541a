"""Run each command with outputs that cannot be written, and print a table of the outcomes.

    python -m tools.attack outputs [COMMAND ...]

The commands and their option -o are those of the command line: one without a row here, or with another option that is a
path and no input, is an error. Each command is first run undisturbed, for the files that it writes. Then each of these,
and the folder of them, is a file, a folder, a device, a pipe or a link. A command may then replace an old file as a
whole, or follow a link to a folder. Otherwise it has to end with a sentence, leave what was there, and leave no
temporary file. Exit code 1: one did not. Full and read-only disks are those of syscalls.py.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import click
import numpy as np

from mpucal.__main__ import run
from mpucal.cli import COMMANDS, commands
from tools.lab.runner import Trial
from tools.lab.table import Column, Row, frequencies
from tools.processes import Child, Ended, ready

QUICK = ("--rate", "25", "--target", "quick", "--yes")
CALIBRATION, TABLE, RECORDED = "a/calibration.json", "walk.npz", "a/capture.mcap"
# Arguments of each command with an output; {} stands for the output.
WORDS: dict[str, tuple[str, ...]] = {
    "session": ("session", "--bus", "sim:seed=1", *QUICK, "--no-write", "-o", "{}"),
    "record": ("record", "--bus", "sim:seed=1", "--seconds", "2", "-o", "{}.mcap"),
    "calibrate": ("calibrate", RECORDED, "-o", "{}"),
    "batch": ("batch", RECORDED, "--workers", "1", "--reports", "-o", "{}"),
    "write": ("write", CALIBRATION, "chip", "--bus", "sim:seed=1", "--yes", "-o", "{}"),
    "check": ("check", CALIBRATION, RECORDED, "-o", "{}"),
    "noise": ("noise", RECORDED, "-o", "{}"),
    "apply": ("apply", CALIBRATION, TABLE, "-o", "{}.csv"),
    "apply .npz": ("apply", CALIBRATION, TABLE, "-o", "{}.npz"),
    "apply .mcap": ("apply", CALIBRATION, TABLE, "-o", "{}.mcap"),
    "stream": ("stream", "--bus", "sim:seed=1", "--apply", CALIBRATION, "--seconds", "1", "-o", "{}.mcap"),
    "export": ("export", CALIBRATION, "--to", "json", "-o", "{}"),
    "merge": ("merge", CALIBRATION, "b/calibration.json", "-o", "{}"),
    "firmware": ("firmware", "-o", "{}"),
}
# Options whose paths are read; `session --resume` continues in the folder of a session.
READ = {"--noise", "--hints", "--apply", "--resume", "calibration", "calibrations", "recording", "file", "a", "b"}
OLD, CODES = b"old", (0, 2, 3, 5, 6)
# a library has many files, and these stand for all
MOST_FILES = 8
SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"


def check_rows() -> str:
    """Return a sentence on rows that WORDS lacks for the command line; empty if it is complete."""
    found: set[str] = set()
    for name in COMMANDS:
        command = commands.get_command(click.Context(commands), name)
        for option in command.params if command else ():
            if option.opts[0] == "-o":
                found.add(name)
            elif isinstance(option.type, click.Path) and option.opts[0] not in READ:
                return f"{name} {option.opts[0]} is a path: read, or written?"
    odd = found ^ {name.split()[0] for name in WORDS}
    return f"no row, or no option -o: {', '.join(sorted(odd))}" if odd else ""


def _linked(path: Path, make: Callable[[Path], object]) -> None:
    make(target := path.with_name("target"))
    path.symlink_to(target)


def _old(path: Path) -> None:
    path.write_bytes(OLD)


OBSTACLES: dict[str, Callable[[Path], object]] = {
    "file": _old,
    "folder": Path.mkdir,
    "device": lambda path: os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3)),
    "pipe": os.mkfifo,
    "link": lambda path: _linked(path, _old),
    "link to a folder": lambda path: _linked(path, Path.mkdir),
    "link to nothing": lambda path: path.symlink_to("nothing"),
}


def obstructed(words: tuple[str, ...], here: Path, file: Path, kind: str) -> str:
    """Run a command with an obstacle at `file` (relative); return the outcome in words."""
    with TemporaryDirectory(dir=here.parent) as place:
        path = Path(place) / file
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            OBSTACLES[kind](path)
        except PermissionError:
            return "not tried"
        was, before = path.lstat(), _content(path)
        done = _run(words, here, Path(place))
        if odd := _odd(done, Path(place)):
            return f"WRONG: {odd}"
        same = os.path.lexists(path) and os.path.samestat(path.lstat(), was)
        if same and _content(path) == before:
            # a state that is saved takes the next free name
            return "left" if done.code in (0, 5) else "refused"
        if done.code in (0, 5) and (kind == "file" or (same and path.is_dir())):
            return "replaced" if kind == "file" else "written into"
        return f"WRONG: exit code {done.code}, and it was changed"


def _content(path: Path) -> object:
    if path.is_file():
        return path.read_bytes()
    return sorted(each.name for each in path.iterdir()) if path.is_dir() else None


def _run(words: tuple[str, ...], here: Path, place: Path) -> Ended:
    """Run a command in `here` with its output in `place`."""
    call = partial(run, [word.format(place / "out") for word in words])
    return Child(call, here, here.parent / "said").go().wait()


def _odd(done: Ended, place: Path) -> str:
    """Return the rules for any command that this one broke, in words; empty if none."""
    odd = [] if done.code == 2 else done.wrong(CODES)
    odd += ["the standard output is blamed"] if "the output cannot be written" in done.last else []
    return "; ".join([*odd, *(f"{path.name} is left" for path in place.rglob(".*"))])


def of_command(name: str) -> list[Row]:
    """Run a command with each obstacle: a row for each output."""
    ready()
    with TemporaryDirectory() as base:
        (here := Path(base) / "here").mkdir()
        (here / "a").mkdir()
        shutil.copy(SESSION, here / RECORDED)
        _run(("calibrate", RECORDED, "-o", "a"), here, here)
        if name == "merge":
            _run((*WORDS["session"], "--bus", "sim:seed=1,temperature_c=45", "-o", "b"), here, here)
        np.savez(here / TABLE, t=np.arange(9) / 9, acc=np.full((9, 3), 9.0), gyr=np.zeros((9, 3)))
        return [
            Row(name=name, kind=kind, outcome=outcome, wrong=outcome.startswith("WRONG"))
            for kind, outcome in tried(WORDS[name], here)
        ]


def tried(words: tuple[str, ...], here: Path) -> Iterator[tuple[str, str]]:
    """Yield each obstacle with the outcome for each file that a command writes, and for their folder."""
    with TemporaryDirectory(dir=here.parent) as place:
        done = _run(words, here, Path(place))
        files = sorted(path.relative_to(place) for path in Path(place).rglob("*") if path.is_file())
    if done.code or not files:
        sys.exit(f"exit code {done.code}: {done.last}")
    yield "nothing", f"{len(files)} files"
    in_folder = files[0].parts[0] == "out" and len(files[0].parts) > 1
    for kind in OBSTACLES:
        yield from ((kind, obstructed(words, here, file, kind)) for file in files[:MOST_FILES])
        if in_folder:
            yield f"{kind}, of the folder", obstructed(words, here, Path("out"), kind)


def scenarios(commands: Annotated[list[str], WORDS, "default: all"] = tuple(WORDS)) -> list[str]:
    """Return the commands, if there is a row for each of the command line's."""
    if lacks := check_rows():
        sys.exit(lacks)
    return commands


COLUMNS: dict[str, Column] = {"outcomes": lambda rows: frequencies(row.outcome for row in rows)}
main = Trial(__doc__, of_command, scenarios, COLUMNS, ("name", "kind"))
