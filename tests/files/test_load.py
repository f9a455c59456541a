from dataclasses import fields

import numpy as np
import pytest

import mpucal
from mpucal.chip.driver import Driver
from mpucal.data import Recording
from mpucal.errors import RecordingError
from mpucal.files.mcap import CaptureWriter
from mpucal.simulated.chip import open_simulated
from mpucal.sources.tap import Tap


def same(a, b):
    for field in fields(Recording):
        if field.name not in ("name", "recovered"):
            np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name), field.name)


def measure(bus, polls):
    driver = Driver(bus)
    driver.start()
    for _ in range(polls):
        driver.poll()
    return driver.recording()


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A session's folder with three seconds of the simulated chip, and what the driver made of them."""
    folder = tmp_path_factory.mktemp("session")
    with CaptureWriter(folder / "capture.mcap") as writer:
        writer.start({"source": "sim"})
        recording = measure(Tap(open_simulated("sim", seed=1), writer), 150)
        writer.event("key", int(recording.t[-1] * 1e9), {"key": "enough"})
    return folder, recording


def test_a_capture_gives_what_the_driver_gave(measured):
    folder, recording = measured
    assert len(recording) > 500
    same(mpucal.load(folder / "capture.mcap"), recording)
    same(mpucal.load(str(folder)), recording)
    assert mpucal.load(folder).recovered is None


def test_a_capture_cut_before_its_first_sample_is_no_recording(measured, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((measured[0] / "capture.mcap").read_bytes()[:600])
    with pytest.raises(RecordingError, match="0 samples"):
        mpucal.load(cut)


def test_the_suffix_says_how_to_read(measured, save, tmp_path):
    _, recording = measured
    save(recording, tmp_path / "a.npz")
    save(recording, tmp_path / "A.CSV")
    same(mpucal.load(tmp_path / "a.npz"), recording)
    np.testing.assert_array_equal(mpucal.load(tmp_path / "A.CSV").acc, recording.acc)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.npz", "there is no file"),
        ("none.mcap", "there is no file"),
        ("notes.odt", r"give a \.mcap, \.tlog, \.bin, \.npz, \.csv file or the folder"),
        ("none", "there is no file"),
        ("no_ending", "not a recording"),
        ("folder", r"holds no capture\.mcap"),
    ],
)
def test_what_is_no_recording(tmp_path, name, says):
    (tmp_path / "notes.odt").write_text("hello")
    (tmp_path / "no_ending").write_text("hello")
    (tmp_path / "folder").mkdir()
    with pytest.raises(RecordingError, match=says) as raised:
        mpucal.load(tmp_path / name)
    assert str(tmp_path / name) in str(raised.value)
