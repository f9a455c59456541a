"""A source that is one module and one row is known to every command that takes a source."""

from pathlib import Path

import pytest

from mpucal.files.mcap import read_capture
from mpucal.result.calibration import Calibration

PROGRAM = Path(__file__).with_name("turntable.py")
TURNTABLE = ("--turntable", "round", "--arm-length", "0.25")
COMMANDS = ("session", "record", "stream", "write", "show", "doctor")


@pytest.fixture(scope="module")
def call(served):
    """The command line of a program that has the row of the turntable, too."""
    return served(PROGRAM.stem)


@pytest.fixture(scope="module")
def measured(tmp_path_factory, call):
    """A folder in which a session on the turntable has left its results."""
    folder = tmp_path_factory.mktemp("turntable")
    words = ("session", *TURNTABLE, "--rate", "25", "--target", "quick", "-o", "board", "--yes")
    done = call(folder, *words)
    assert done.code == 0, done.err
    return folder


def test_a_session_runs_on_the_new_source_and_its_capture_names_it(measured):
    assert Calibration.load(measured / "board" / "calibration.json").quality["verdict"] == "good"
    meta = read_capture(measured / "board" / "capture.mcap").meta
    assert meta["source"] == {"turntable": "round", "arm_length": 0.25}
    assert meta["plan"]["config"]["rate_hz"] == 25


def test_a_session_that_broke_off_goes_on_with_it(call, measured, write_capture, tmp_path):
    whole = read_capture(measured / "board" / "capture.mcap")
    (tmp_path / "board").mkdir()
    write_capture(tmp_path / "board" / "capture.mcap", whole.meta, whole.records[: len(whole.records) // 4])
    done = call(tmp_path, "session", "--resume", "board", "--yes")
    assert done.code == 0, done.err
    assert read_capture(tmp_path / "board" / "capture-2.mcap").meta["source"] == whole.meta["source"]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_names_it(call, tmp_path, command):
    said = " ".join(call(tmp_path, command, "--help").out.split())
    assert "--turntable NAME The name of a turntable." in said
    assert "--arm-length M How far out the chip is [m]." in said


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["session"], 2, "no source was given: give exactly one of --bus BUS, "),
        (["session"], 2, " and --turntable NAME."),
        (["doctor", "--replay", "x.mcap"], 2, "and --turntable NAME"),
        (["session", *TURNTABLE, "--bus", "sim"], 2, "--bus and --turntable were given together"),
        (
            ["session", "--bus", "sim", "--arm-length", "1"],
            2,
            "--bus sim does not take --arm-length",
        ),
        (["session", *TURNTABLE, "--seed", "1"], 2, "--turntable does not take --seed"),
        (["session", "--replay", "x.mcap", "--arm-length", "1"], 2, "--replay does not take --arm-length, which the"),
        (["session", "--resume", "x", *TURNTABLE], 2, "--resume does not take --turntable"),
        (["session", *TURNTABLE, "--to", "bridge"], 2, "--turntable has no bridge"),
        (["show", "x.npz", *TURNTABLE], 2, "a file and --turntable were given together"),
        (["session", "--turntable", "broken"], 3, "the turntable is broken: mend it."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_usage_errors_name_the_new_source(call, tmp_path, words, code, says):
    done = call(tmp_path, *words)
    assert done.code == code
    assert says in done.err
    assert not list(tmp_path.iterdir())
