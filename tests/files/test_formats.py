"""A format is one row: one that is made up here is known to everything that reads or writes recordings."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.data import Recording
from mpucal.errors import RecordingError
from mpucal.files import formats, open_rows
from mpucal.files.formats import FORMATS, Format, readable_formats, writable_formats

ROOT = Path(__file__).parents[2]
FIXTURE = ROOT / "fixtures" / "sessions" / "mpu6050.mcap"

# a format of a suffix of its own, both ways, and a dialect of tables, whose times are in ms; then a command
MADE_UP = """
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from mpucal.data import Samples
from mpucal.files import formats
from mpucal.files.csv import csv_rows
from mpucal.files.rows import Rows


def words_rows(path):
    table = np.array([line.split() for line in path.read_text().splitlines()], float)
    no = np.zeros(len(table), bool)
    unknown = np.full(len(table), np.nan)
    return Rows(iter([Samples(table[:, 0], table[:, 1:4], table[:, 4:7], unknown, no, no, no)]), name=path.name)


@contextmanager
def words_file(path, rows, done):
    with path.open("w") as file:
        yield lambda samples: np.savetxt(file, np.column_stack([samples.t, samples.acc, samples.gyr]))


def is_milliseconds(path):
    return path.read_text().startswith("# ms")


def milliseconds_rows(path):
    path.with_suffix(".plain").write_text(path.read_text().partition("\\n")[2])
    rows = csv_rows(path.with_suffix(".plain"))
    return replace(rows, runs=(replace(samples, t=samples.t / 1000.0) for samples in rows.runs))


def register():
    formats.FORMATS = (
        formats.Format(".csv", "a table in ms", rows="made_up:milliseconds_rows", recognises="made_up:is_milliseconds"),
        *formats.FORMATS,
        formats.Format(".words", "a page of words", rows="made_up:words_rows", writer="made_up:words_file"),
    )


if __name__ == "__main__":
    import io
    import json
    from contextlib import redirect_stderr, redirect_stdout

    import made_up
    from mpucal.__main__ import run

    made_up.register()
    said = []
    for words in json.loads(sys.argv[1]):
        with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
            said.append((run(words), out.getvalue(), err.getvalue()))
    print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write the made-up formats to a folder, with a recording and its calibration."""
    folder = tmp_path_factory.mktemp("formats")
    (folder / "made_up.py").write_text(MADE_UP)
    (folder / "notes.odt").write_text("hello")
    whole = mpucal.load(FIXTURE)
    table = np.column_stack([whole.t, whole.acc, whole.gyr])
    np.savetxt(folder / "walk.words", table)
    table[:, 0] *= 1000.0
    text = "".join(",".join(map(repr, row)) + "\n" for row in table.tolist())
    (folder / "walk.csv").write_text(f"# ms\nt,ax,ay,az,gx,gy,gz\n{text}")
    return folder


CALLS = (
    ("calibrate", "walk.words", "-o", "results", "--json"),
    ("calibrate", str(FIXTURE), "--json"),
    ("show", "walk.words", "--json"),
    ("show", "walk.csv", "--json"),
    ("show", "notes.odt"),
    ("apply", "results/calibration.json", "walk.words", "-o", "out.words"),
    ("apply", "results/calibration.json", "walk.csv", "-o", "ms.words"),
    ("apply", "results/calibration.json", "walk.words", "-o", "out.txt"),
    *((command, "--help") for command in ("calibrate", "show", "apply")),
)


@pytest.fixture(scope="module")
def call(folder):
    """Run CALLS one after the other in a process that knows the made-up formats: exit codes and messages."""
    words = [sys.executable, "made_up.py", json.dumps(CALLS)]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
    said = dict(zip(CALLS, json.loads(done.stdout), strict=True))
    return lambda *words: said[words]


def test_it_is_calibrated(call):
    found = json.loads(call("calibrate", "walk.words", "-o", "results", "--json")[1])
    wanted = json.loads(call("calibrate", str(FIXTURE), "--json")[1])
    assert found["fit"]["samples"] == wanted["fit"]["samples"]
    np.testing.assert_allclose(found["accelerometer"]["D"], wanted["accelerometer"]["D"], atol=1e-3)


@pytest.mark.parametrize("name", ["walk.words", "walk.csv"])
def test_it_is_shown(call, name):
    shown, whole = json.loads(call("show", name, "--json")[1]), mpucal.load(FIXTURE)
    assert shown["samples"] == len(whole)
    assert shown["seconds"] == pytest.approx(whole.t[-1] - whole.t[0])


@pytest.mark.parametrize(("source", "target"), [("walk.words", "out.words"), ("walk.csv", "ms.words")])
def test_it_is_applied_to_and_written(call, folder, source, target):
    code, _, error = call("apply", "results/calibration.json", source, "-o", target)
    assert code == 0, error
    acc = mpucal.Calibration.load(folder / "results" / "calibration.json").apply(mpucal.load(FIXTURE).acc)
    np.testing.assert_allclose(np.loadtxt(folder / target)[:, 1:4], acc, atol=1e-9)


@pytest.mark.parametrize("command", ["calibrate", "show", "apply"])
def test_the_help_names_it(call, command):
    said = " ".join(call(command, "--help")[1].split())
    assert "a page of words (.words)" in said
    assert ("a table in ms (.csv)" in said) == (command != "apply")


def test_errors_name_it(call):
    assert re.search(r"give a [^:]*\.words file or the folder", call("show", "notes.odt")[2])
    code, _, error = call("apply", "results/calibration.json", "walk.words", "-o", "out.txt")
    assert code == 3
    assert re.search(r"end its name with .*\.words", error)


def two(path):
    return Recording.from_arrays([0.0, 1.0], np.ones((2, 3)), np.zeros((2, 3)), name=path.name)


def test_a_format_that_is_loaded_whole_has_rows_too(tmp_path, monkeypatch):
    monkeypatch.setattr(formats, "FORMATS", (*FORMATS, Format(".two", "two samples", load=f"{__name__}:two")))
    (tmp_path / "a.two").touch()
    rows = open_rows(tmp_path / "a.two")
    assert rows.name == "a.two"
    np.testing.assert_array_equal(rows.recording().acc, mpucal.load(tmp_path / "a.two").acc)


def test_what_no_dialect_recognises_is_told_by_the_last_of_its_suffix(tmp_path, monkeypatch):
    dialect = Format(".csv", "a dialect", load="nowhere:nothing", recognises="builtins:callable")
    monkeypatch.setattr(formats, "FORMATS", (dialect, *FORMATS))
    (tmp_path / "a.csv").write_text("one,two\n")
    with pytest.raises(RecordingError, match="names no columns of"):
        mpucal.load(tmp_path / "a.csv")


def test_the_page_names_each():
    text = " ".join((ROOT / "docs" / "recordings.md").read_text(encoding="utf-8").split())
    read, written = readable_formats(), writable_formats()
    assert f"`mpucal calibrate`, `show` and `apply` read {read}; `apply -o` writes {written}." in text
