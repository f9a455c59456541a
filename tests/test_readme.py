"""What the README shows is what a newcomer sees."""

import contextlib
import io
import re
from pathlib import Path

import pytest

from mpucal.__main__ import run
from mpucal.cli import COMMANDS

PROJECT = Path(__file__).parents[1]
README = (PROJECT / "README.md").read_text(encoding="utf-8")
SHOWN, PYTHON = re.findall(r"```(?:python)?\n(.*?)```", README, re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the shown session was run, and what it printed."""
    folder = tmp_path_factory.mktemp("readme")
    command = SHOWN.splitlines()[0].removeprefix("$ mpucal ").split()
    said, printed = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        assert run(command) == 0
    return folder, said.getvalue(), printed.getvalue()


def shape(text):
    """The lines but for their numbers, and for the width that these take."""
    return [re.sub(r" +", " ", re.sub(r"\d+(\.\d+)?", "#", line)).strip() for line in text.splitlines() if line]


def test_the_session_is_a_real_one(folder):
    _, said, printed = folder
    shown = shape(SHOWN)[1:]
    assert shown[-len(shape(printed)) :] == shape(printed)
    # the keys and the line that is written over are a terminal's
    talk = [line for line in shown[: -len(shape(printed))] if not line.startswith("(Enter")]
    assert [line for line in talk if line not in shape(said)] == []


def test_the_python_works(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder[0])
    exec(PYTHON, {})
    assert capsys.readouterr().out.startswith("good ")
    assert (folder[0] / "calibration.json").exists()


def test_every_command_is_there_and_no_other():
    assert set(re.findall(r"^ {4}mpucal (\w+)", README, re.MULTILINE)) == set(COMMANDS)


def test_what_it_links_to_is_there():
    for target in re.findall(r"\]\(([^):]+)\)", README):
        assert (PROJECT / target).exists()
    for tool in re.findall(r"tools/\w+\.py", README):
        assert (PROJECT / tool).exists()
