"""The command line, called as a person calls it."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
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
    """Call it as a process of its own, in a folder."""

    def call(folder: Path, *words):
        done = subprocess.run(
            [sys.executable, "-m", "mpucal", *map(str, words)], cwd=folder, capture_output=True, text=True, check=False
        )
        return Result(done.returncode, done.stdout, done.stderr)

    return call


@dataclass(frozen=True)
class Session:
    folder: Path
    result: Result


@pytest.fixture(scope="session")
def session(tmp_path_factory, process):
    """One whole session on the simulated chip."""
    folder = tmp_path_factory.mktemp("session")
    return Session(
        folder / "board", process(folder, "session", "--bus", "sim", "--seed", "3", "--rate", "100", "-o", "board")
    )
