"""Arguments of the public functions: messages on wrong ones, and other types that are accepted."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import mpucal
from mpucal import Calibration, MpucalError, Recording
from mpucal.calibration import MODELS
from mpucal.result.keys import Model

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6500.mcap"
N = 40
arrays = Recording.from_arrays
T, ACC, GYR = np.arange(N) / 100.0, np.tile([0.1, 0.2, 9.8], (N, 1)), np.zeros((N, 3))
DATES = np.datetime64("2026-03-01T12:00:00") + (1e6 * T).astype("timedelta64[us]")
A_RECORDING = Recording.from_arrays(T, ACC, GYR)
A_CALIBRATION = Calibration(np.eye(3), np.zeros(3))

WRONG = {
    "no recording": (lambda: mpucal.calibrate(ACC), TypeError, "ndarray is not a recording: give a mpucal.Recording"),
    "no model": (lambda: mpucal.calibrate(A_RECORDING, "autoo"), ValueError, "there is no model 'autoo': choose one"),
    "no gravity": (lambda: mpucal.calibrate(A_RECORDING, gravity=-1), ValueError, "gravity is -1"),
    "load no path": (lambda: mpucal.load(5), TypeError, "a recording is given as int: give the path of its file"),
    "columns": (lambda: A_CALIBRATION.apply(ACC.T), ValueError, r"acc has shape \(3, 40\), not .*: give acc.T, in m/s"),
    "D a number": (
        lambda: Calibration(1.0, np.zeros(3)),
        ValueError,
        r"D has shape \(\): give numbers of shape \(3, 3",
    ),
    "days before": (lambda: mpucal.check(A_CALIBRATION, A_RECORDING, -7), ValueError, "days is -7: give"),
    "no range": (
        lambda: mpucal.load("no.csv", accel_range=0),
        ValueError,
        "accel_range is 0: give the full scale in g",
    ),
    "save no path": (lambda: A_CALIBRATION.save(None), TypeError, "the file of a calibration is given as NoneType"),
    "dates as acc": (
        lambda: arrays(T, np.tile(DATES, (3, 1)).T, GYR),
        ValueError,
        "acc .*they are times",
    ),
    "no data frame": (lambda: Recording.from_dataframe(ACC), TypeError, "ndarray is not a data frame"),
    "other frames": (lambda: A_RECORDING.to_dataframe("excel"), ValueError, "data frames of 'excel' are not supported"),
}


@pytest.mark.parametrize(("call", "kind", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_argument_is_reported_in_one_sentence(call, kind, says):
    with pytest.raises(MpucalError, match=says) as raised:
        call()
    assert isinstance(raised.value, kind)
    assert str(raised.value).endswith(".") and "\n" not in str(raised.value)


def test_a_path_is_accepted_as_a_recording():
    by_path, by_name = (mpucal.calibrate(path, "accel") for path in (CAPTURE, str(CAPTURE)))
    of_recording = mpucal.calibrate(mpucal.load(CAPTURE), "accel")
    assert replace(by_path, created="") == replace(by_name, created="") == replace(of_recording, created="")


def test_dates_are_seconds_since_the_first():
    np.testing.assert_allclose(Recording.from_arrays(DATES.astype("datetime64[ms]"), ACC, GYR).t, T, atol=1e-9)
    np.testing.assert_allclose(Recording.from_arrays((DATES - DATES[0]), ACC, GYR).t, T, atol=1e-9)


def test_the_names_of_models_that_a_type_checker_knows_are_all():
    assert set(get_args(Model)) == set(MODELS)
