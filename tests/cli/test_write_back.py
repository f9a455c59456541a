"""A session that writes to the chip it calibrated, and the question before it writes."""

from pathlib import Path

import numpy as np
import pytest

from mpucal.cli import person
from mpucal.errors import WriteBackError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from tools.processes import quick


@pytest.mark.parametrize("answer", ["y\n", "n\n", None], ids=["yes", "no", "no terminal"])
def test_a_question_is_asked_on_a_terminal_only(monkeypatch, answer):
    monkeypatch.setattr("sys.stdin.isatty", lambda: answer is not None, raising=False)
    asked = []
    monkeypatch.setattr("click.confirm", lambda question, err: asked.append(question) or answer == "y\n")
    if answer == "n\n":
        with pytest.raises(WriteBackError, match="you declined"):
            person.ask("Write?", yes=False)
    else:
        person.ask("Write?", yes=False)
    person.ask("Write?", yes=True)
    assert len(asked) == (answer is not None)


def test_a_session_writes_to_the_chip_and_says_so(mpucal):
    source = ("--bus", "sim", "--seed", "3", "--rate", "50", "--target", "quick")
    with quick():
        result = mpucal("session", *source, "--to", "chip", "-o", "board", "--json", "--yes")
    assert result.code == 0, result.err
    made = Calibration.load("board/calibration.json")
    assert result.out == made.json()
    (entry,) = made.extra["written"]
    assert (entry["to"], entry["where"]) == ("chip", "the chip on sim")
    # A word of the register is 0.5 mg, and only even words are written.
    np.testing.assert_allclose(made.applied_in_hardware, made.b_a, atol=0.0055)
    np.testing.assert_array_equal(
        Calibration.load("board/calibration.bin").applied_in_hardware, np.float32(made.applied_in_hardware)
    )
    assert "offset registers" in Path("board/report.html").read_text()
    assert "Results are written to files and the chip's offset registers" in result.err
    # The capture was recorded before the write, so all of b_a is subtracted from its samples.
    mpucal("apply", "board/calibration.json", "board", "-o", "out.npz")
    acc = (load("board").acc - made.b_a) @ np.linalg.inv(made.D).T
    np.testing.assert_allclose(load("out.npz").acc, acc, atol=1e-12)
