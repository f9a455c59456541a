"""Calibrations and recordings as values of Python: shown in a notebook, compared, pickled, in another process."""

import html
import json
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from copy import copy, deepcopy
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.data import Autopilot
from mpucal.report.units import accelerometer

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6500.mcap"


@pytest.fixture(scope="module")
def recording():
    return mpucal.load(CAPTURE)


@pytest.fixture(scope="module")
def calibration(recording):
    return mpucal.calibrate(recording, "hand")


def test_recordings_and_calibrations_describe_themselves_in_a_line(recording, calibration):
    seconds = recording.t[-1] - recording.t[0]
    rate = 1.0 / np.median(np.diff(recording.t))
    assert repr(recording) == f"<Recording mpu6500.mcap: {len(recording)} samples, {seconds:.1f} s at {rate:.1f} Hz>"
    assert repr(calibration).startswith("<Calibration of MPU-6500: good; scale factor error +2.")
    assert max(map(len, (repr(recording), repr(calibration)))) < 120
    assert "nan" in repr(mpucal.calibrate(recording.part(0, 50)))


def test_results_describe_themselves_in_a_line_and_compare_by_value(recording, calibration):
    checked, noise = mpucal.check(calibration, recording), mpucal.noise(recording)
    assert repr(checked).startswith("<CheckResult: still good; the bias is within ")
    assert repr(noise).startswith("<Noise of MPU-6500: white noise ")
    for result in (checked, noise):
        assert len(repr(result)) < 120
        assert pickle.loads(pickle.dumps(result)) == result != recording
    assert checked != mpucal.check(calibration, recording, days=30.0)
    assert noise != mpucal.noise(recording.part(0, 5000))


def test_the_table_holds_the_numbers(calibration):
    page = html.unescape(calibration._repr_html_())
    assert all(f">{cell}<" in page for row in accelerometer(calibration) for cell in row.cells if cell)
    assert ">good." in page


def test_the_figures_hold_the_data(recording, calibration):
    pytest.importorskip("matplotlib")
    magnitude, rests, innovations = calibration.plot(recording).axes
    before, after, gravity = (np.asarray(line.get_ydata()) for line in magnitude.lines)
    a = np.linalg.norm(calibration.apply(recording.acc), axis=1)
    assert (after.min(), after.max()) == (a.min(), a.max())
    assert not np.array_equal(before, after) and set(gravity) == {9.80665}
    before, after, _ = (np.abs(line.get_ydata()).max() for line in rests.lines)
    assert after < 0.1 * before
    assert len(innovations.lines) == 3
    upper, lower = recording.plot().axes
    assert [max(line.get_ydata()) for line in upper.lines] == recording.acc.max(axis=0).tolist()
    assert len(lower.lines) == 3


def test_the_figure_of_a_calibration_holds_its_parameters(calibration):
    pytest.importorskip("matplotlib")
    figure = calibration.plot()
    assert figure._repr_png_().startswith(b"\x89PNG\r\n")
    panels = pickle.loads(pickle.dumps(figure)).axes
    assert [len(axes.get_xticklabels()) for axes in panels] == [3, 3, 6]
    drawn = [value for axes in panels for value in axes.containers[-1].lines[0].get_ydata()]
    rows = accelerometer(calibration)
    assert drawn == [value for row in rows for value, cell in zip(row.value, row.cells, strict=True) if cell]


def test_figures_without_matplotlib_say_what_to_install(recording, calibration, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for plot in (recording.plot, calibration.plot):
        with pytest.raises(ImportError, match=r"figures need matplotlib: pip install 'mpucal\[plot\]'"):
            plot()


def test_copies_and_pickles_are_equal_and_a_changed_value_is_not(recording, calibration):
    imu = replace(recording, autopilot=Autopilot("PX4", 1, "HIGHRES_IMU", {"a": 1.0}), others=(recording,))
    for way in (lambda value: pickle.loads(pickle.dumps(value)), copy, deepcopy):
        assert [way(value) for value in (imu, calibration)] == [imu, calibration]
    acc = recording.acc.copy()
    acc[7, 1] = np.nextafter(acc[7, 1], 99.0)
    assert recording != replace(recording, acc=acc)
    assert recording != replace(recording, name="another")
    assert calibration != replace(calibration, b_a=np.nextafter(calibration.b_a, 99.0))
    assert calibration != replace(calibration, quality={**calibration.quality, "verdict": "usable"})
    for value in (recording, calibration):
        with pytest.raises(TypeError, match="unhashable"):
            hash(value)


def test_mappings_of_a_calibration_equal_its_document_and_are_read_only(calibration):
    assert json.loads(json.dumps(calibration.fit)) == calibration.document()["fit"]
    for change in (
        lambda fit: fit.update(model="imu"),
        lambda fit: fit.pop("model"),
        lambda fit: fit.__setitem__("model", "imu"),
        lambda fit: fit.__delitem__("model"),
        lambda fit: fit.__ior__({"model": "imu"}),
    ):
        with pytest.raises(TypeError, match="cannot be changed"):
            change(calibration.fit)
    assert {**calibration.fit, "model": "imu"}["model"] == "imu"


@pytest.mark.slow  # the gate tests pickling, by which values are sent
def test_a_pool_of_processes_calibrates_as_this_process_does(recording, calibration):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(mpucal.calibrate, recording, "hand").result()
    assert replace(there, created=calibration.created) == calibration
