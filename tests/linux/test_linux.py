"""mpucal on a real Linux kernel, in QEMU: --bus and --iio on its own drivers, over the simulated chip.

Outside of the usual run: `make kernel`. MPUCAL_KERNEL names a Debian linux-image package (.deb); without, the first in
build/kernel is taken.
"""

import json

import pytest

pytestmark = pytest.mark.kernel


def test_the_kernels_buffer_is_read(said):
    """What inv_mpu6050 puts there: the counts of the chip, at the rate that it was set to, with its own scales."""
    assert said["probed"]["buffer"]
    found = said["buffered recording"]
    assert found["samples"] >= 18
    # by so much inv_sensors_timestamp lets a period move with the interrupt's time, here a Python thread's
    assert found["steps_ms"] == pytest.approx([20, 20, 20], rel=0.04)
    assert (found["sensor"]["accel_range_g"], found["sensor"]["gyro_range_dps"]) == (4, 500)
    assert found["acc"][0] == pytest.approx(-found["acc"][1])
    assert found["acc"][2] - found["acc"][0] == pytest.approx(8192 * 0.001196)
    assert found["gyr"][1:] == pytest.approx([2000 * 0.000266181, -3072 * 0.000266181])
    assert said["put back"] == said["put back"] | {"enable": "0\n", "rate": "50\n"}


def test_a_second_reader_and_an_empty_buffer_are_one_sentence(said):
    assert "another program reads the buffer of iio:device0" in said["another reader"]["code"]
    assert "register 0" in said["empty"]["code"]


def test_the_bus_is_read_and_recorded(said):
    """However slow the emulated machine is: a few samples are enough to see that they are the chip's."""
    found = said["recording"]
    assert found["samples"] >= 5
    assert found["rate_hz"] == pytest.approx(50, rel=0.03)
    assert found["sensor"]["chip"] == "MPU-6050"
    marks = {line["topic"]: line["mark"] for line in json.loads(said["doctor"]["output"])["findings"]}
    assert marks["chip"] == "ok"


def test_a_chip_that_the_kernel_holds_is_polled(said):
    """--bus names the device, and through it the same chip shows the same accelerations."""
    held = said["held"]["code"]
    assert "a driver of the kernel holds the chip" in held
    assert f"give --iio {said['bound']['device']} in place of --bus" in held
    found = said["polled recording"]
    assert found["samples"] >= 3
    assert found["acc"] == pytest.approx(said["recording"]["acc"], abs=0.3)
    marks = {line["topic"]: line["mark"] for line in json.loads(said["examined"]["output"])["findings"]}
    assert (marks[said["bound"]["device"]], marks["buffer"]) == ("ok", "note")


def test_calibbias_is_written_and_read_back_through_the_kernel(said):
    before, after = said["calibbias"]["before"], said["calibbias"]["after"]
    assert after == [word + 100 for word in before]
