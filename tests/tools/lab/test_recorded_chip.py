"""Recording behind the simulated chip."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Samples
from mpucal.errors import EndOfCapture, RecordingError, UsageError
from tools.lab.recorded_chip import open_recorded

G0 = 9.80665


def recorded(n=300, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(-32768, 32768, (n, 3)), rng.integers(-32768, 32768, (n, 3))


def served(bus, config):
    driver, parts = Driver(bus, config), []
    driver.start()
    while True:
        try:
            parts.append(driver.poll())
        except EndOfCapture:
            return Samples.joined(parts)


def test_a_recordings_counts_come_out_as_they_are():
    acc, gyr = recorded()
    samples = served(open_recorded(acc, gyr, 100, 2, 250), Config(accel_range_g=2, gyro_range_dps=250, rate_hz=100))
    n = len(samples)
    assert 290 <= n <= 300
    np.testing.assert_allclose(samples.acc, acc[-n:] / 16384 * G0, rtol=1e-12)
    np.testing.assert_allclose(samples.gyr, np.radians(gyr[-n:] / 131), rtol=1e-12)


@pytest.mark.parametrize(
    ("config", "says"),
    [
        (Config(4, 250, 100), "set to 4 g, the recording to 2 g"),
        (Config(2, 500, 100), "set to 500 deg/s, the recording to 250 deg/s"),
        (Config(2, 250, 200), "set to 200 Hz, the recording to 100 Hz"),
    ],
    ids=["accelerometer", "gyroscope", "rate"],
)
def test_a_chip_set_otherwise_than_the_recording_is_an_error(config, says):
    with pytest.raises(UsageError, match=says):
        served(open_recorded(*recorded(), 100, 2, 250), config)


@pytest.mark.parametrize(
    ("acc", "gyr"),
    [
        (np.zeros((5, 3)), np.zeros((4, 3))),
        (np.zeros((5, 2)), np.zeros((5, 2))),
        *((np.full((5, 3), value), np.zeros((5, 3))) for value in (0.5, 32768, np.nan)),
    ],
    ids=["not as many", "two axes", "fractions", "beyond 16 bits", "no numbers"],
)
def test_counts_that_are_no_recording_are_refused(acc, gyr):
    with pytest.raises(RecordingError):
        open_recorded(acc, gyr, 100, 2, 250)


def test_a_recording_has_no_truth_and_hears_nothing():
    bus = open_recorded(*recorded(), 100, 2, 250)
    bus.hear(SimpleNamespace(kind="rotate", down=None))
    assert bus.truth_document() is None
