"""`mpucal write ... chip`, a session that writes to the chip it calibrated, and the question before a write."""

import json
from pathlib import Path

import numpy as np
import pytest

from mpucal.cli import common
from mpucal.errors import WriteBackError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from tools.processes import quick


@pytest.fixture(scope="module")
def calibrated(session):
    return session.folder / "calibration.json"


def test_the_written_calibration_states_what_the_chip_subtracts(mpucal, calibrated, tmp_path):
    written = mpucal("write", calibrated, "chip", "--bus", "sim:seed=3", "-o", tmp_path, "--json", code=0)
    b_a = json.loads(calibrated.read_text())["accelerometer"]["b_a"]
    assert json.loads(written.out)["applied_in_hardware"]["b_a"] == pytest.approx(b_a, abs=0.006)
    left = {path.name for path in tmp_path.iterdir()}
    assert left >= {"chip-offsets.json", "calibration-on-chip.json", "calibration-on-chip.bin"}
    assert json.loads((tmp_path / "calibration-on-chip.json").read_text()) == json.loads(written.out)
    # The registers are volatile, which is said; the old state is restored from its file.
    again = mpucal("write", tmp_path / "chip-offsets.json", "chip", "--bus", "sim:seed=3", "-o", tmp_path)
    assert (again.code, again.out[:6]) == (0, "Done: ")
    assert "volatile" in mpucal("write", calibrated, "chip", "--bus", "sim:seed=3", "-o", tmp_path).out


def test_numbers_that_changed_since_are_written_only_by_force(mpucal, spoilt, tmp_path):
    words = ("write", spoilt, "chip", "--bus", "sim:seed=3", "-o", tmp_path / "out")
    refused = mpucal(*words)
    assert (refused.code, "its digest does not match" in refused.err) == (6, True)
    assert not (tmp_path / "out").exists()
    assert mpucal(*words, "--force").code == 0
    shown = mpucal("show", spoilt)
    assert (shown.code, "its digest does not match" in shown.err) == (0, True)


def test_a_refusal_is_exit_code_6_and_says_what_the_chip_holds(mpucal, calibrated, tmp_path):
    result = mpucal("write", calibrated, "chip", "--bus", "sim:seed=4", "-o", tmp_path, code=6)
    assert "the old state of the offset registers is restored" in result.err
    assert not (tmp_path / "calibration-on-chip.json").exists()


@pytest.mark.parametrize("answer", ["y\n", "n\n", None], ids=["yes", "no", "no terminal"])
def test_a_question_is_asked_on_a_terminal_only(monkeypatch, answer):
    monkeypatch.setattr("sys.stdin.isatty", lambda: answer is not None, raising=False)
    asked = []
    monkeypatch.setattr("click.confirm", lambda question, err: asked.append(question) or answer == "y\n")
    if answer == "n\n":
        with pytest.raises(WriteBackError, match="you declined"):
            common.ask("Write?", yes=False)
    else:
        common.ask("Write?", yes=False)
    common.ask("Write?", yes=True)
    assert len(asked) == (answer is not None)


def test_a_session_writes_to_the_chip_and_notes_it_in_its_files(mpucal):
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
