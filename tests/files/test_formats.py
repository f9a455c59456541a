"""A format is one row: one that is made up here is known to everything that reads or writes recordings."""

from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.chip.driver import Driver
from mpucal.data import Recording, Samples
from mpucal.errors import OutputError, RecordingError
from mpucal.files import formats, open_rows, open_writer
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.csv import csv_rows
from mpucal.files.formats import FORMATS, Format, readable_formats, writable_formats
from mpucal.files.rows import Rows
from mpucal.simulated.chip import open_simulated
from mpucal.sources.replay import Tap

ROOT = Path(__file__).parents[2]


def words_rows(path):
    table = np.loadtxt(path)
    no = np.zeros(len(table), bool)
    samples = Samples(table[:, 0], table[:, 1:4], table[:, 4:7], np.full(len(table), np.nan), no, no, no)
    return Rows(iter([samples]), name=path.name)


@contextmanager
def words_file(path, rows, done):
    with path.open("w") as file:
        yield lambda samples: np.savetxt(file, np.column_stack([samples.t, samples.acc, samples.gyr]))


def is_milliseconds(path):
    return path.read_text().startswith("# ms")


def milliseconds_rows(path):
    path.with_suffix(".plain").write_text(path.read_text().partition("\n")[2])
    rows = csv_rows(path.with_suffix(".plain"))
    return replace(rows, runs=(replace(samples, t=samples.t / 1000.0) for samples in rows.runs))


def two(path):
    return Recording.from_arrays([0.0, 1.0], np.ones((2, 3)), np.zeros((2, 3)), name=path.name)


@pytest.fixture
def made_up(monkeypatch):
    """Know a format of a suffix of its own, both ways, a dialect of tables whose times are in ms, and two samples."""
    here = __name__
    dialect = Format(".csv", "a table in ms", rows=f"{here}:milliseconds_rows", recognises=f"{here}:is_milliseconds")
    words = Format(".words", "a page of words", rows=f"{here}:words_rows", writer=f"{here}:words_file")
    rows = (dialect, *FORMATS, words, Format(".two", "two samples", load=f"{here}:two"))
    monkeypatch.setattr(formats, "FORMATS", rows)


def test_a_format_is_read_written_and_named(made_up, walk, table, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with open_writer(Path("walk.words"), Rows.of(walk), "") as write:
        write(walk)
    table("# ms\nt,ax,ay,az,gx,gy,gz", walk.t * 1000, walk.acc, walk.gyr)
    for name in ("walk.words", "walk.csv"):
        rows = open_rows(Path(name))
        np.testing.assert_allclose(np.concatenate([samples.t for samples in rows.runs]), walk.t, atol=1e-12)
    Path("notes.odt").touch()
    with pytest.raises(RecordingError, match=r"give a .*, \.words, \.two file or the folder"):
        mpucal.load("notes.odt")
    with pytest.raises(OutputError, match=r"end its name with .*\.words"):
        open_writer(Path("out.txt"), Rows.of(walk), "")


def test_a_format_that_is_loaded_whole_has_rows_too(made_up, tmp_path):
    (tmp_path / "a.two").touch()
    rows = open_rows(tmp_path / "a.two")
    assert rows.name == "a.two"
    np.testing.assert_array_equal(rows.recording().acc, mpucal.load(tmp_path / "a.two").acc)


def test_a_file_without_a_dialect_is_refused_by_the_last_of_its_suffix(made_up, tmp_path):
    (tmp_path / "a.csv").write_text("one,two\n")
    with pytest.raises(RecordingError, match="names no columns of"):
        mpucal.load(tmp_path / "a.csv")


def test_the_page_names_each_format():
    text = " ".join((ROOT / "docs" / "recordings.md").read_text(encoding="utf-8").split())
    read, written = readable_formats(), writable_formats()
    assert f"`mpucal calibrate`, `show` and `apply` read {read}; `apply -o` writes {written}." in text


def test_a_capture_gives_what_the_driver_gave(save, tmp_path):
    """Read three seconds of the simulated chip from the folder of its session, its capture, and an archive."""
    with CaptureWriter(tmp_path / "capture.mcap") as writer:
        writer.start({"source": "sim"})
        driver = Driver(Tap(open_simulated("sim", seed=1), writer.transaction))
        driver.start()
        for _ in range(150):
            driver.poll()
    recording = driver.recording()
    assert len(recording) > 500
    save(recording, tmp_path / "A.NPZ")
    for path in (tmp_path / "capture.mcap", tmp_path, str(tmp_path), tmp_path / "A.NPZ"):
        read = mpucal.load(path)
        for field in fields(Recording):
            if field.name != "name":
                np.testing.assert_array_equal(getattr(read, field.name), getattr(recording, field.name), field.name)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((tmp_path / "capture.mcap").read_bytes()[:600])
    with pytest.raises(RecordingError, match="0 samples"):
        mpucal.load(cut)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.npz", "there is no file"),
        ("none", "there is no file"),
        ("no_ending", "not a recording"),
        ("folder", r"holds no capture\.mcap"),
    ],
)
def test_other_paths_are_refused_with_their_reason(tmp_path, name, says):
    (tmp_path / "no_ending").write_text("hello")
    (tmp_path / "folder").mkdir()
    with pytest.raises(RecordingError, match=says) as raised:
        mpucal.load(tmp_path / name)
    assert str(tmp_path / name) in str(raised.value)
