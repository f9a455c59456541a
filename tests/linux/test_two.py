"""Accelerometer and gyroscope of two devices of the kernel, in QEMU; `make kernel` runs this."""

import pytest

PART = "two"
PRINTED = 0.001196 * 8192 / 9.80665
pytestmark = pytest.mark.kernel


def test_two_devices_make_a_session_that_says_what_their_times_cost(guest, near):
    """The timer in place of INT wires keeps no chip's phase: stamps differ by what either FIFO holds."""
    quality = near(guest, PRINTED).quality
    assert quality["verdict"] == "good" or "clock_off" in [reason["code"] for reason in quality["reasons"]]
