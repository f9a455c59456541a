"""A sink that is one module and one row is known to every command that writes a calibration."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.calibration import Calibration

PROGRAM = Path(__file__).with_name("logbook.py")
SIM = ("--bus", "sim:seed=3,arm=steady", "--rate", "25", "--target", "quick", "--yes")


@pytest.fixture(scope="module")
def call(served):
    """The command line of a program that has the row of the logbook, too."""
    return served(PROGRAM.stem)


@pytest.fixture(scope="module")
def measured(tmp_path_factory, call):
    """A folder in which a session on a source with a logbook has written to it, asked by nobody."""
    folder = tmp_path_factory.mktemp("logbook")
    return folder, call(folder, "session", *SIM, "-o", "board")


@pytest.fixture
def board(measured, tmp_path):
    """A copy of it, to be changed."""
    shutil.copytree(measured[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_a_session_writes_to_the_new_sink_by_default_and_records_its_effect(measured):
    folder, done = measured
    assert done.code == 0, done.err
    assert "Results are written to files and the logbook (change with --to or --no-write)." in done.err
    assert "Done: the logbook of sim:seed=3,arm=steady says b_a." in done.out
    found = Calibration.load(folder / "board" / "calibration.json")
    assert (folder / "logbook.txt").read_text() == f"b_a: {found.b_a.tolist()}\n"
    assert [(entry["to"], entry["where"]) for entry in found.extra["written"]] == [
        ("logbook", "the logbook of sim:seed=3,arm=steady")
    ]
    assert not Calibration.load(folder / "board" / "calibration-on-logbook.json").b_a.any()
    assert (folder / "board" / "logbook-old.txt").read_text() == "b_a: nothing\n"
    assert "`mpucal write board/logbook-old.txt logbook ...` restores it" in done.err


def test_no_write_leaves_the_sink_alone(call, tmp_path):
    done = call(tmp_path, "session", *SIM, "--tilt-only", "-o", "board", "--no-write")
    assert done.code == 0, done.err
    assert not (tmp_path / "logbook.txt").exists()
    assert not (tmp_path / "board" / "calibration-on-logbook.json").exists()


def test_several_sinks_are_written_in_the_order_of_the_table(call, tmp_path):
    done = call(tmp_path, "session", *SIM, "--tilt-only", "-o", "board", "--to", "logbook", "--to", "chip")
    assert done.code == 0, done.err
    written = Calibration.load(tmp_path / "board" / "calibration.json").extra["written"]
    assert [entry["to"] for entry in written] == ["chip", "logbook"]


def test_a_calibration_is_written_and_the_previous_state_restored(call, board):
    first = (board / "logbook.txt").read_text()
    Calibration(np.eye(3), np.array([0.5, 0.0, 0.0])).save(board / "later.json")
    written = call(board, "write", "later.json", "logbook", "--bus", "sim", "--ink", "--json")
    assert written.code == 0, written.err
    assert "this is sim, in ink" in written.err
    assert (board / "logbook.txt").read_text() == "b_a: [0.5, 0.0, 0.0]\n"
    assert json.loads(written.out) == json.loads((board / "later-on-logbook.json").read_text())

    back = call(board, "write", "logbook-old.txt", "logbook", "--bus", "sim")
    assert (back.code, back.out) == (0, "Done: the logbook of sim says again what logbook-old.txt says.\n")
    assert (board / "logbook.txt").read_text() == first
    # The state in between is saved as well.
    assert (board / "logbook-old-2.txt").read_text() == "b_a: [0.5, 0.0, 0.0]\n"


def test_a_write_that_cannot_be_recorded_is_undone(call, board):
    before = (board / "logbook.txt").read_text()
    (board / "board" / "calibration-on-logbook.json").unlink()
    (board / "board" / "calibration-on-logbook.json").mkdir()
    done = call(board, "write", "board/calibration.json", "logbook", "--bus", "sim")
    assert done.code == 6
    assert "the logbook of sim says again what logbook-old-2.txt says" in done.err
    assert (board / "logbook.txt").read_text() == before


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("session", "--mavlink", "sim", "--to", "logbook"),
            "has no logbook: give --bus BUS, or leave it out.",
        ),
        (("session", *SIM, "--to", "logbook", "--no-write"), "--to and --no-write exclude each other"),
        (("session", *SIM, "--to", "diary"), "'logbook'"),
        (("write", "c.json", "logbook", "--mavlink", "sim"), "--mavlink sim has no logbook: give --bus BUS."),
        (
            ("write", "c.json", "logbook", "--replay", "c.mcap"),
            "`mpucal write` does not take it",
        ),
        (("write", "c.json", "chip", "--bus", "sim", "--ink"), "--ink was given, and the chip's offset registers"),
        (("write", "c.json", "logbook", "--bus", "sim", "--store"), "--store was given, and the logbook"),
        (("write", "c.json", "diary", "--bus", "sim"), "'logbook'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_usage_errors_name_the_new_sink(call, tmp_path, words, says):
    done = call(tmp_path, *words)
    assert done.code == 2
    assert says in " ".join(done.err.split())
    assert not list(tmp_path.iterdir())
