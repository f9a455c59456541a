"""The session that the README shows is what a newcomer sees."""

import contextlib
import io
import re
from pathlib import Path

from mpucal.__main__ import run

README = Path(__file__).parents[1] / "README.md"


def shape(text):
    """The lines but for their numbers, and for the width that these take."""
    return [re.sub(r" +", " ", re.sub(r"\d+(\.\d+)?", "#", line)).strip() for line in text.splitlines() if line]


def test_the_session_is_a_real_one(tmp_path):
    said, printed = io.StringIO(), io.StringIO()
    with contextlib.chdir(tmp_path), contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        assert run(["session", "--bus", "sim"]) == 0
    shown = shape(re.search(r"```\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)[1])
    result = shape(printed.getvalue())
    assert shown[-len(result) :] == result
    # the keys are named, and a line is written over, on a terminal only
    talk = [line for line in shown[: -len(result)] if not line.startswith("(Enter")]
    assert {"LAY FLAT", "ROTATE", "VERIFY", "REST"} <= set(talk)
    # in the order in which they are said, with some left out
    program = iter(shape(said.getvalue()))
    assert [line for line in talk if line not in program] == []
