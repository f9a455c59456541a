"""Accelerometer and gyroscope of two devices of the kernel, in QEMU; `make kernel` runs this."""

import pytest

PART = "two"
pytestmark = pytest.mark.kernel


def test_a_session_of_two_devices_reports_the_error_of_their_times(guest, near):
    """A timer in place of INT wires keeps no chip's phase, so stamps differ by the samples that a FIFO holds."""
    quality = near(guest).quality
    assert quality["verdict"] == "good" or "clock_off" in [reason["code"] for reason in quality["reasons"]]
