"""The command line, called as a person calls it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import pytest

from mpucal.__main__ import run


@dataclass(frozen=True)
class Result:
    code: int
    out: str
    err: str


@pytest.fixture
def mpucal(capsys, tmp_path, monkeypatch):
    """Call it in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        capsys.readouterr()
        code = run([str(word) for word in words])
        captured = capsys.readouterr()
        return Result(code, captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def process():
    """Call it, or another program, as a process of its own in a folder."""

    def call(folder: Path, *words, program=("-m", "mpucal")):
        done = subprocess.run(
            [sys.executable, *program, *map(str, words)], cwd=folder, capture_output=True, text=True, check=False
        )
        return Result(done.returncode, done.stdout, done.stderr)

    return call


@dataclass(frozen=True)
class Session:
    folder: Path
    result: Result


@pytest.fixture(scope="session")
def session(once, process):
    """One whole session on the simulated chip; nothing is to be changed in its folder."""

    def make(folder):
        words = ("session", "--bus", "sim", "--seed", "3", "--rate", "100", "-o", "board")
        (folder / "result.json").write_text(json.dumps(asdict(process(folder, *words))))

    folder = once("cli-session", make)
    return Session(folder / "board", Result(**json.loads((folder / "result.json").read_text())))


class Served:
    """A program of this folder that adds to mpucal's tables: a process that runs one command line after the other."""

    def __init__(self, program: str) -> None:
        words = [sys.executable, Path(__file__).with_name("served.py"), program]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self, folder: Path, *words) -> Result:
        assert self._process.stdin and self._process.stdout
        print(json.dumps([str(folder), *map(str, words)]), file=self._process.stdin, flush=True)
        return Result(*json.loads(self._process.stdout.readline()))

    def end(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="module")
def served():
    """served(program): see Served."""
    begun = []

    def call(program):
        begun.append(Served(program))
        return begun[-1]

    yield call
    for each in begun:
        each.end()


# how long a busy machine may take, for what takes it a second or two
PATIENCE_S = 300.0


@pytest.fixture(scope="session")
def stopped_at():
    """Run held.py in a folder, send its session a signal while it is held, and wait until it ended."""

    def call(folder: Path, held, sign, *words):
        said, began_s = folder / "said.txt", time.monotonic()
        program = [sys.executable, Path(__file__).with_name("held.py"), *map(str, held)]
        with (
            said.open("w") as stderr,
            subprocess.Popen([*program, *words], cwd=folder, stderr=stderr, stdout=subprocess.DEVNULL) as process,
        ):
            try:
                while not (folder / "held").exists():
                    assert process.poll() is None, said.read_text()
                    assert time.monotonic() < began_s + PATIENCE_S, said.read_text()
                    time.sleep(0.01)
                process.send_signal(sign)
                (folder / "go").touch()
                process.wait(PATIENCE_S)
            finally:
                process.kill()
        for name in ("held", "go"):
            (folder / name).unlink()
        return Result(process.returncode, "", said.read_text())

    return call
