"""The session that the tutorial shows is what a newcomer sees, and what the pages show of Python runs."""

import contextlib
import io
import re
import shutil
from pathlib import Path

import pytest

import mpucal
from mpucal.__main__ import run

PROJECT = Path(__file__).parents[1]
TUTORIAL = (PROJECT / "docs" / "tutorial.md").read_text(encoding="utf-8")


def shape(text):
    """The lines but for their numbers, and for the width that these take."""
    return [re.sub(r" +", " ", re.sub(r"\d+(\.\d+)?", "#", line)).strip() for line in text.splitlines() if line]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """The folder in which a session was run, what it said and what it printed."""
    folder = tmp_path_factory.mktemp("readme")
    said, printed = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        assert run(["session", "--bus", "sim", "-o", "first"]) == 0
    return folder, said.getvalue(), printed.getvalue()


def test_the_session_is_a_real_one(session):
    _, said, printed = session
    shown = shape(re.search(r"```\n(.*?)```", TUTORIAL, re.DOTALL)[1])
    result = shape(printed)
    assert shown[-len(result) :] == result
    # the keys are named, and a line is written over, on a terminal only
    talk = [line for line in shown[: -len(result)] if not line.startswith("(Enter")]
    assert {"LAY FLAT", "TURN IT", "CHECK", "PUT IT DOWN"} <= set(talk)
    # in the order in which they are said, with some left out
    program = iter(shape(said))
    assert [line for line in talk if line not in program] == []


@pytest.mark.parametrize("name", ["README.md", "docs/tutorial.md", "docs/python.md"])
def test_the_python_of_a_page_runs(session, name, tmp_path, capsys):
    pytest.importorskip("polars")
    (made,) = session[0].iterdir()
    for copy in ("first", "board7"):
        shutil.copytree(made, tmp_path / copy)
    for copy in ("walk", "night"):
        shutil.copy(made / "capture.mcap", tmp_path / f"{copy}.mcap")
    recording = mpucal.load(made / "capture.mcap")
    names = {"t": recording.t, "acc": recording.acc, "gyr": recording.gyr, "df": recording.to_dataframe("polars")}
    programs = re.findall(r"```python\n(.*?)```", (PROJECT / name).read_text(encoding="utf-8"), re.DOTALL)
    with contextlib.chdir(tmp_path):
        for program in programs:
            exec(program, names)
    assert programs and names["calibration"].verdict == "good"
