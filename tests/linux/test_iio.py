"""mpucal on the kernel's own driver, inv_mpu6050, in QEMU; `make kernel` runs this, outside of the usual run."""

import json

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.data import STANDARD_GRAVITY_MPS2

PART = "iio"
pytestmark = pytest.mark.kernel
# inv_mpu6050 prints 9.80665 / 8192 with these digits.
PRINTED = 0.001196 * 8192 / STANDARD_GRAVITY_MPS2
# interrupt.c mounts them so.
MOUNTED = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])


def recorded(guest, step):
    return mpucal.load(guest.out / f"{step}.mcap")


def test_a_chip_that_the_kernel_holds_is_pointed_to_by_its_other_name(guest):
    said = guest.said["held"]["code"]
    assert "a driver of the kernel holds the chip" in said
    assert f"use --iio {guest.said['bound']['device']} instead of --bus" in said


def test_the_doctor_finds_the_driver_in_order(guest):
    findings = {one["topic"]: one for one in json.loads(guest.said["doctor"]["out"])["findings"]}
    assert guest.said["doctor"]["code"] == 0
    assert "mount matrix 0, 1, 0; -1, 0, 0; 0, 0, 1" in findings[guest.said["bound"]["device"]]["what"]
    assert "filled by mpu6050-dev0" in findings["buffer"]["what"]
    assert not [topic for topic, one in findings.items() if one["mark"] == "bad"]


def test_buffer_and_channels_show_the_same(guest):
    buffered, polled = recorded(guest, "buffered"), recorded(guest, "polled")
    assert min(len(buffered), len(polled)) > 150
    assert not buffered.gap.any()
    for found in (buffered, polled):
        assert found.rate_hz == pytest.approx(50, rel=0.01)
        assert (found.sensor.chip, found.sensor.accel_range_g) == ("MPU-6050", 4)
        assert found.sensor.temperature_c == pytest.approx(guest.said["truth"]["temperature_c"], abs=0.5)
    np.testing.assert_allclose(buffered.acc.mean(0), polled.acc.mean(0), atol=0.05)
    np.testing.assert_allclose(buffered.gyr.mean(0), polled.gyr.mean(0), atol=0.01)


def test_the_settings_are_restored(guest):
    assert guest.said["put back"] == guest.said["put back"] | {"enable": "0\n", "rate": "50\n"}


def test_a_session_on_the_buffer_ends_good_and_replays_elsewhere(guest, near, tmp_path):
    found = near(guest)
    assert found.quality["verdict"] == "good"
    assert run(["session", "--replay", str(guest.out / "session"), "-o", str(tmp_path / "x"), "--yes", "--json"]) == 0
    assert mpucal.load(guest.out / "session/capture.mcap") == mpucal.load(tmp_path / "x/capture.mcap")
    again = mpucal.Calibration.load(tmp_path / "x/calibration.json")
    np.testing.assert_allclose(again.D, found.D, rtol=0, atol=1e-9)


def test_a_calibration_goes_into_calibbias_and_to_udev_and_out_again(guest):
    """b_a is gone from what the kernel delivers, in steps of 1 mg; D is udev's."""
    before, after, again = (recorded(guest, step) for step in ("as it was", "corrected", "as it is again"))
    found = mpucal.Calibration.load(guest.out / "session/calibration.json")
    assert guest.said["written"]["code"] == 0
    moved = (before.acc.mean(0) - after.acc.mean(0)) / STANDARD_GRAVITY_MPS2
    np.testing.assert_allclose(moved, found.b_a / STANDARD_GRAVITY_MPS2, atol=2e-3)
    (rule,) = guest.said["rules"]["rules"]
    text = rule.partition('ENV{ACCEL_MOUNT_MATRIX}="')[2].partition('"')[0]
    matrix = np.array([[float(value) for value in row.split(",")] for row in text.split(";")])
    # What the driver prints is PRINTED of the data sheet's scale, in which D is.
    np.testing.assert_allclose(PRINTED * matrix @ found.D, MOUNTED, atol=1e-8)
    assert guest.said["put back by mpucal"]["code"] == 0
    np.testing.assert_allclose(again.acc.mean(0), before.acc.mean(0), atol=0.01)


@pytest.mark.parametrize(
    ("step", "says"),
    [
        (
            "another reader",
            "another program reads the buffer of iio:device0: stop it (`sudo fuser -v /dev/iio",
        ),
        ("empty", "the buffer of iio:device0 stays empty: it waits for interrupts that do not come"),
        ("unbound", "iio:device0 is gone; /out/unbound.mcap has the "),
    ],
)
def test_each_fault_is_one_sentence(guest, step, says):
    assert guest.said[step]["code"].startswith(says)


def test_an_overrun_is_a_gap_and_a_sentence(guest):
    assert "samples are missing in" in guest.said["overrun"]["said"]
    found = recorded(guest, "overrun")
    assert found.gap.any()
    assert np.diff(found.t)[found.gap[1:]].max() > 1
