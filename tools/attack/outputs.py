"""Run each command with outputs that cannot be written, and print a table of the outcomes.

    python -m tools.attack outputs [COMMAND ...]

The commands and their option -o are those of the command line: one without a row here, or with another option that is a
path and no input, is an error. Each command is first run undisturbed, for the files that it writes. Then each of these,
and the folder of them, is a file, a folder, a device, a pipe or a link. A command may then replace an old file as a
whole, or follow a link to a folder. Otherwise it has to end with a sentence, leave what was there, and leave no
temporary file. Exit code 1: one did not. Full and read-only disks are those of syscalls.py.
"""

import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import click

from mpucal.__main__ import run
from mpucal.cli import COMMANDS, commands
from tools.lab.runner import Trial
from tools.lab.table import Column, Row, frequencies
from tools.processes import Child, Ended, ready

from .syscalls_commands import WORDS, prepared

# what is given to -o stands for the output
COMMANDS_WITH_OUTPUT = {
    **WORDS,
    "batch": ["batch", "in.mcap", "--workers", "1", "--reports", "-o", "board"],
    "apply .npz": ["apply", "a.json", "in.npz", "-o", "out.npz"],
    "apply .mcap": ["apply", "a.json", "in.npz", "-o", "out.mcap"],
}
# Options whose paths are read; `session --resume` continues in the folder of a session.
READ = {"--noise", "--hints", "--apply", "--resume", "calibration", "calibrations", "recording", "file", "a", "b"}
OLD, CODES = b"old", (0, 2, 3, 5, 6)
# a library has many files, and these stand for all
MOST_FILES = 8


def check_rows() -> str:
    """Return a sentence on rows that are missing for the command line; empty if it is complete."""
    found: set[str] = set()
    for name in COMMANDS:
        command = commands.get_command(click.Context(commands), name)
        for option in command.params if command else ():
            if option.opts[0] == "-o":
                found.add(name)
            elif isinstance(option.type, click.Path) and option.opts[0] not in READ:
                return f"{name} {option.opts[0]} is a path: read, or written?"
    odd = found ^ {words[0] for words in COMMANDS_WITH_OUTPUT.values()}
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


def obstructed(words: Sequence[str], here: Path, file: Path, kind: str) -> str:
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


def _run(words: Sequence[str], here: Path, place: Path) -> Ended:
    """Run a command in `here` with its output in `place`."""
    words = list(words)
    at = words.index("-o") + 1
    words[at] = str((place / "out").with_suffix(Path(words[at]).suffix))
    return Child(partial(run, words), here, here.parent / "said").go().wait()


def _odd(done: Ended, place: Path) -> str:
    """Return the rules for any command that this one broke, in words; empty if none."""
    odd = [] if done.code == 2 else done.wrong(CODES)
    odd += ["the standard output is blamed"] if "the output cannot be written" in done.last else []
    return "; ".join([*odd, *(f"{path.name} is left" for path in place.rglob(".*"))])


def of_command(item: tuple[str, Path]) -> list[Row]:
    """Run a command with each obstacle: a row for each output."""
    ready()
    name, start = item
    with TemporaryDirectory() as base:
        here = Path(base) / "here"
        shutil.copytree(start, here)
        outcomes = tried(COMMANDS_WITH_OUTPUT[name], here)
        return [Row(name=name, kind=kind, outcome=told, wrong=told.partition("WRONG: ")[2]) for kind, told in outcomes]


def tried(words: Sequence[str], here: Path) -> Iterator[tuple[str, str]]:
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


def scenarios(
    commands: Annotated[Sequence[str], COMMANDS_WITH_OUTPUT, "default: all"] = tuple(COMMANDS_WITH_OUTPUT),
) -> list[tuple[str, Path]]:
    """Return the commands, if there is a row for each of the command line's, with a folder of their inputs."""
    if lacks := check_rows():
        sys.exit(lacks)
    start = prepared()
    return [(name, start) for name in commands]


COLUMNS: dict[str, Column] = {"outcomes": lambda rows: frequencies(row.outcome for row in rows)}
main = Trial(__doc__, of_command, scenarios, COLUMNS, ("name", "kind"))
