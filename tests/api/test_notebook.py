"""Calibrations and recordings as a notebook shows them."""

from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.report.units import accelerometer

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6500.mcap"


@pytest.fixture(scope="module")
def recording():
    return mpucal.load(CAPTURE)


@pytest.fixture(scope="module")
def calibration(recording):
    return mpucal.calibrate(recording, "hand")


class Texts(HTMLParser):
    def __init__(self):
        super().__init__()
        self.texts = []

    def handle_data(self, data):
        self.texts.append(data)


def test_they_say_in_a_line_what_they_are(recording, calibration):
    seconds = recording.t[-1] - recording.t[0]
    rate = 1.0 / np.median(np.diff(recording.t))
    assert repr(recording) == f"<Recording mpu6500.mcap: {len(recording)} samples, {seconds:.1f} s at {rate:.1f} Hz>"
    assert repr(calibration).startswith("<Calibration of MPU-6500: good; scale factor error +2.774 ")
    assert max(map(len, (repr(recording), repr(calibration)))) < 120
    assert "nan" in repr(mpucal.calibrate(recording.part(0, 50)))


def test_the_table_holds_the_numbers(calibration):
    page = Texts()
    page.feed(calibration._repr_html_())
    cells = {cell for row in accelerometer(calibration) for cell in row.cells if cell}
    assert cells <= set(page.texts)
    assert any(text.startswith("good.") for text in page.texts)


def test_the_figures_hold_the_data(recording, calibration):
    pytest.importorskip("matplotlib")
    (axes,) = calibration.plot(recording).axes
    before, after, gravity = (np.asarray(line.get_ydata()) for line in axes.lines)
    a = np.linalg.norm(calibration.apply(recording.acc), axis=1)
    assert (after.min(), after.max()) == (a.min(), a.max())
    assert not np.array_equal(before, after) and set(gravity) == {9.80665}
    upper, lower = recording.plot().axes
    assert [max(line.get_ydata()) for line in upper.lines] == recording.acc.max(axis=0).tolist()
    assert len(lower.lines) == 3
