"""Arrays with the stamps of bursts calibrate like those of an even clock, and lost bursts are reported."""

from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.data import Sensor
from mpucal.errors import ArraysError
from tools.lab.scenarios.family import drawn
from tools.lab.scenarios.table import FAMILIES

HZ = 100.7


@pytest.fixture(scope="module")
def even():
    return replace(drawn(FAMILIES["poses"], 1).recording, sensor=Sensor(), flat=None)


def arrived(t, every_s, late_s):
    """Stamps of samples that a radio sends in bursts, late by so much on average, and a program reads in turn."""
    burst, at = np.unique(np.floor(t / every_s), return_inverse=True)
    late = np.random.default_rng(0).exponential(late_s, len(burst)) if late_s else 0.0
    stamps = np.maximum.accumulate((burst + 1) * every_s + late)[at]
    return np.maximum.accumulate(stamps + 60e-6 * (np.arange(len(t)) - np.searchsorted(stamps, stamps)))


def test_late_stamps_are_no_lost_data(even):
    acc, gyr = even.acc, even.gyr * HZ / even.rate_hz
    t = np.arange(len(acc)) / HZ
    of_even = mpucal.calibrate(mpucal.Recording.from_arrays(t, acc, gyr))
    # over USB, by Bluetooth, by a timer, and all samples of a burst at one time
    usb, radio, timer = arrived(t, 0.016, 3e-3), arrived(t, 0.06, 10e-3), arrived(t, 0.06, 0.0)
    for stamps in (usb, radio, timer, np.ceil(t / 0.06) * 0.06):
        recording = mpucal.Recording.from_arrays(stamps, acc, gyr, name="walk")
        found = mpucal.calibrate(recording)
        assert (found.verdict, of_even.verdict) == ("good", "good")
        np.testing.assert_allclose(found.D, of_even.D, rtol=0, atol=1e-6)
        assert recording.taken.startswith("walk: its times are arrival stamps, ")
        assert recording.taken.endswith("without gaps.")


def test_lost_bursts_are_gaps(even):
    t = np.arange(len(even)) / HZ
    burst = np.floor(t / 0.06)
    kept = ~np.isin(burst, [300, 301, 302, 500, 501, 502, 503, 504])
    stamps = arrived(t, 0.06, 10e-3)[kept]
    recording = mpucal.Recording.from_arrays(stamps, even.acc[kept], even.gyr[kept] * HZ / even.rate_hz)
    assert np.flatnonzero(recording.gap).tolist() == [np.count_nonzero(kept & (burst < at)) for at in (303, 505)]
    (lost,) = (each for each in mpucal.calibrate(recording).quality["reasons"] if each["code"] == "data_lost")
    assert "in 2 places" in lost["message"]


def test_times_that_decrease_or_stand_are_still_refused(even):
    t = np.arange(len(even)) / HZ
    for times in (t[::-1], np.zeros(len(t))):
        with pytest.raises(ArraysError, match="time does not increase at sample 1 "):
            mpucal.Recording.from_arrays(times, even.acc, even.gyr)
