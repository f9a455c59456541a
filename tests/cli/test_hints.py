"""Recordings in commands: all take the same hints, a refusal names missing ones, and a damaged file is reported."""

import json
import pickle
import shlex
from pathlib import Path

import numpy as np
import pytest

import mpucal as package
from mpucal.batch.row import Settings, make_row
from mpucal.cli.recording_options import hint_words, read_hints_file
from mpucal.data import STANDARD_GRAVITY_MPS2
from mpucal.errors import UsageError
from mpucal.files.hints import Hints
from mpucal.result.calibration import Calibration

FIXTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
SAID = ("--columns", "t=a,ax=b,ay=e,az=c,gx=f,gy=d,gz=g", "--units", "t=s,acc=m/s^2,gyr=rad/s")


@pytest.fixture(scope="module")
def recording():
    return package.load(FIXTURE).part(0, 3000)


@pytest.fixture
def table(recording, tmp_path):
    """Write a table whose columns have unknown names, in an unusual order; return its path."""
    r = recording
    columns = [r.t, *r.acc[:, [0, 2]].T, r.gyr[:, 1], r.acc[:, 1], *r.gyr[:, [0, 2]].T]
    np.savetxt(tmp_path / "odd.csv", np.column_stack(columns), delimiter=",", header="a,b,c,d,e,f,g", comments="")
    return tmp_path / "odd.csv"


def test_a_command_takes_columns_and_span(mpucal, table, recording):
    assert mpucal("show", "odd.csv").code == 3
    assert json.loads(mpucal("show", "odd.csv", "--json", *SAID).out)["samples"] == len(recording)
    cut = mpucal("show", "odd.csv", "--json", *SAID, "--span", "2:7")
    assert json.loads(cut.out)["samples"] == pytest.approx(5 * recording.rate_hz, abs=1)


@pytest.mark.parametrize("command", ["calibrate", "check", "noise", "apply", "show"])
def test_each_command_reports_that_a_capture_is_cut_short(mpucal, session, command):
    whole = (session.folder / "capture.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) // 2])
    calibration = [session.folder / "calibration.json"] if command in ("check", "apply") else []
    assert "cut.mcap is cut short or damaged" in mpucal(command, *calibration, "cut.mcap").err


def test_a_batch_takes_hints_by_pattern(table, recording, tmp_path):
    (tmp_path / "hints").write_text(f"# those of the old logger\n\nodd*.csv {shlex.join(SAID)}\n*.txt --rate 100\n")
    by_pattern = read_hints_file(tmp_path / "hints")
    settings = Settings("accel", 9.80665, by_pattern=by_pattern)
    assert [pattern for pattern, _ in by_pattern] == ["odd*.csv", "*.txt"]
    assert settings.find_hints("line3/b.txt").rate_hz == 100
    assert settings.find_hints("b.csv") == Hints()
    plain = Settings("accel", 9.80665)
    assert [settings.key(name) == plain.key(name) for name in ("b.csv", "odd.csv")] == [True, False]
    # Dask sends settings to a worker by pickle.
    row = make_row(str(table), pickle.loads(pickle.dumps(settings)))
    assert row["samples"] == len(recording)
    assert "its columns are a, b, c, d, e, f, g" in make_row(str(table), Settings("accel", 9.80665))["error"]
    for line in ("*.csv --units acc=feet", "*.csv --rate", "*.csv 'open", "*.csv more"):
        (tmp_path / "hints").write_text(f"*.txt --rate 100\n{line}\n")
        with pytest.raises(UsageError, match="line 2 is not a pattern with options"):
            read_hints_file(tmp_path / "hints")


def test_a_batch_ends_with_the_command_that_reads_what_it_could_not(mpucal, recording):
    names = "time,accX,accY,accZ,gyroX (rad/s),gyroY (rad/s),gyroZ (rad/s)"
    rows = np.column_stack([recording.t, recording.acc, np.degrees(recording.gyr)])
    for name in ("a[1].csv", "b.csv"):
        np.savetxt(name, rows, delimiter=",", header=names, comments="")
    Path("given").write_text("b.csv --span 5:\n")
    words = ["a[[]1].csv", "b.csv", "-o", "fleet", "--workers", "1", "--model", "accel"]
    Path("fleet").mkdir()
    Path("fleet/hints.txt").write_text("other.csv --rate 50\n")
    found = mpucal("batch", *words, "--hints", "given")
    assert "2 could not be read" in found.out
    command = found.err.splitlines()[-1].partition("try `")[2].removesuffix("`")
    assert shlex.split(command) == ["mpucal", "batch", *words, "--hints", "fleet/hints.txt"]
    kept = dict(read_hints_file(Path("fleet/hints.txt")))
    assert kept["b.csv"].span is not None and kept["other.csv"].rate_hz == 50.0
    # a worker's rows by these hints, without another start of workers
    settings = Settings("accel", STANDARD_GRAVITY_MPS2, by_pattern=read_hints_file(Path("fleet/hints.txt")))
    assert not any(make_row(name, settings).get("error") for name in ("a[1].csv", "b.csv"))


@pytest.mark.parametrize(
    "words",
    [
        *("--columns t=1,ax=2 --units t=ms,acc=g --accel-range 4.0 --gyro-range 500.0", "--topic /imu --rate 100.0"),
        *("--columns t=when,ax=a --span 2:7.5", "--span 5:"),
    ],
)
def test_hints_as_the_words_that_give_them(words, tmp_path):
    (tmp_path / "hints").write_text(f"* {words}")
    ((_, hints),) = read_hints_file(tmp_path / "hints")
    assert hint_words(hints) == words.split()


def test_a_refusal_ends_with_the_whole_command_that_works(mpucal, recording):
    names = "time,accX,accY,accZ,gyroX (rad/s),gyroY (rad/s),gyroZ (rad/s)"
    rows = np.column_stack([recording.t, recording.acc, np.degrees(recording.gyr)])
    np.savetxt("in.csv", rows, delimiter=",", header=names, comments="")
    Calibration(np.eye(3), np.zeros(3), quality={"verdict": "good", "reasons": []}).save("c.json")
    refused = mpucal("apply", "c.json", "in.csv", "-o", "out.npz", code=3)
    command = refused.err.splitlines()[-1].removeprefix("mpucal: try `").removesuffix("`")
    assert command == "mpucal apply c.json in.csv -o out.npz --units gyr=deg/s"
    assert mpucal(*shlex.split(command)[1:]).code == 0
    # A recording that is read, but refused, ends with the command that reads it right.
    rows = (recording.t, recording.acc / STANDARD_GRAVITY_MPS2, recording.gyr)
    np.savetxt("in.csv", np.column_stack(rows), delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    found = mpucal("calibrate", "in.csv", "--units", "t=s,acc=m/s^2")
    assert found.out.endswith("and run\n  mpucal calibrate in.csv --units t=s,acc=g\n")


TAKEN, HAS_NONE = "x/y/board", "192.0.2.1:9"  # a folder that cannot be made, and an address of no computer
INSTEAD = {
    f"session --bus sim -o {TAKEN}": "session --bus sim -o board",
    f"session --page={HAS_NONE} --bus sim --yes": "session --bus sim --yes",
    f"session --page {HAS_NONE} --bus sim --yes": "session --bus sim --yes",
    "session --bus sim --rate 5000": "session --bus sim --rate 1000",
    "session --rate=4000 --bus sim": "session --bus sim --rate 1000",
    "session --bus sim --to file --to kernel -o r": "session --bus sim --to file -o r",
    "session --bus sim --to=bridge": "session --bus sim",
    "session --no-write --to chip --bus sim": "session --to chip --bus sim",
    "session --mavlink sim --dlpf 2 --yes": "session --mavlink sim --yes",
    "session --resume board --bus sim": "session --resume board",
    "session --bus sim --model hand --tilt-only": "session --bus sim --tilt-only",
}


@pytest.mark.parametrize("refused", INSTEAD)
def test_a_refused_session_ends_with_the_whole_command_before_a_board_is_lifted(refused, mpucal):
    Path("x").write_text("no folder")
    found = mpucal(*refused.split())
    assert found.err.endswith(f"mpucal: try `mpucal {INSTEAD[refused]}`\n")
    assert "Lay the board" not in found.err


def test_a_part_of_any_recording_is_read(recording):
    whole, part = package.load(FIXTURE), package.load(FIXTURE, span="2:7")
    first = int(np.searchsorted(whole.t - whole.t[0], 2.0))
    np.testing.assert_array_equal(part.acc, whole.acc[first : first + len(part)])
    assert part.t[-1] - whole.t[0] < 7.0
    with pytest.raises(package.MpucalError, match="give a --span within that"):
        package.load(FIXTURE, span="2000:")
    for text in ("7", "7:2", "-1:3", "a:b", "nan:3"):
        with pytest.raises(package.MpucalError, match="is not a span"):
            package.load(FIXTURE, span=text)
