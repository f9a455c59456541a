"""mpucal over a real /dev/i2c-N of a Linux kernel in QEMU; `make kernel` runs this, outside of the usual run."""

import json

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.result.calibration import Calibration

PART = "bus"
pytestmark = pytest.mark.kernel


def test_the_doctor_finds_the_chip_in_order(guest):
    findings = {one["topic"]: one for one in json.loads(guest.said["doctor"]["out"])["findings"]}
    assert guest.said["doctor"]["code"] == 0
    assert findings["chip"]["data"]["chip"] == "MPU-6050"
    assert "i2c-tiny-usb" in findings["adapter"]["what"]
    assert "not measurable" in findings["bus speed"]["what"]
    assert not [topic for topic, one in findings.items() if one["mark"] == "bad"]


def test_every_sample_is_recorded(guest):
    found = mpucal.load(guest.out / "recorded.mcap")
    rate_hz = 50 * (1 + guest.said["truth"]["rate_error_ppm"] * 1e-6)
    assert len(found) > 150
    assert not found.gap.any()
    assert found.rate_hz == pytest.approx(rate_hz, rel=1e-3)
    assert (found.sensor.chip, found.sensor.accel_range_g) == ("MPU-6050", 4)


def test_a_session_ends_good_with_the_chips_own_truth(guest, near):
    assert near(guest).quality["verdict"] == "good"


def test_the_capture_of_the_guest_replays_on_the_host(guest, tmp_path):
    """The host has another processor: the samples are equal, and the numbers but for their last digits."""
    words = ["session", "--replay", str(guest.out / "session"), "-o", str(tmp_path / "again"), "--yes", "--json"]
    assert run(words) == 0
    there, here = (mpucal.load(folder / "capture.mcap") for folder in (guest.out / "session", tmp_path / "again"))
    assert there == here
    of = [Calibration.load(folder / "calibration.json") for folder in (guest.out / "session", tmp_path / "again")]
    np.testing.assert_allclose(of[0].D, of[1].D, rtol=0, atol=1e-9)
    np.testing.assert_allclose(of[0].b_a, of[1].b_a, rtol=0, atol=1e-9)


def test_an_adapter_that_is_unplugged_is_one_sentence(guest):
    assert guest.said["unplugged"]["code"].startswith("the adapter is gone (/dev/i2c-")
    assert len(mpucal.load(guest.out / "unplugged.mcap")) > 50
