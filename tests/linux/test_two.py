"""Accelerometer and gyroscope of two devices of the kernel, in QEMU; `make kernel` runs this."""

import pytest

PART = "two"
pytestmark = pytest.mark.kernel


def test_two_devices_make_a_session_that_ends_good(guest, good):
    found = good(guest, "session")
    assert found.sensor.chip == "MPU-6050"
