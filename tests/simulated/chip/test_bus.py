"""Simulated bus: its time, and the driver on it."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.driver import Driver
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.clock import RealClock


def prompt(kind):
    return SimpleNamespace(kind=kind, down=None)


def session(bus, seconds, rotate_s=None):
    """Return a driver's recording of a hand that lays the board flat and, at `rotate_s`, turns it."""
    driver = Driver(bus)
    driver.start()
    bus.hear(prompt("lay_flat"))
    begin_ns = driver.now_ns()
    while driver.now_ns() < begin_ns + seconds * 1e9:
        driver.poll()
        if rotate_s is not None and driver.now_ns() >= begin_ns + rotate_s * 1e9:
            bus.hear(prompt("rotate"))
    return driver.recording()


@pytest.mark.parametrize(
    ("text", "who_am_i"),
    [("sim", 0x68), ("sim:chip=mpu6500", 0x70), ("sim:chip=clone98", 0x98), ("sim:who_am_i=0x72", 0x72)],
)
def test_the_chip_answers(text, who_am_i):
    assert open_simulated(text).read(reg.WHO_AM_I, 1).data == bytes([who_am_i])


def test_transfers_take_their_time_at_400_khz():
    bus = open_simulated()
    assert bus.read(reg.FIFO_R_W, 56).t_ns == 0
    assert bus.write(reg.SMPLRT_DIV, b"\x04") == (27 + 3 + 9 * 56) * 2500
    bus.sleep_until(5_000_000)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000
    bus.sleep_until(1)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000 + 39 * 2500


def test_at_a_real_pace_time_is_the_hosts():
    clock = RealClock()
    start = clock.now()
    clock.spend(3_000_000)
    assert clock.now() >= start + 3_000_000
    clock.sleep_until(start + 8_000_000)
    assert clock.now() >= start + 8_000_000


def test_a_session_is_the_same_every_time():
    first, second = (session(open_simulated("sim:seed=9"), 5, rotate_s=2) for _ in range(2))
    np.testing.assert_array_equal(first.t, second.t)
    np.testing.assert_array_equal(first.acc, second.acc)
    np.testing.assert_array_equal(first.gyr, second.gyr)


@pytest.mark.parametrize("chip", ["mpu6050", "mpu6500", "clone98"])
def test_the_driver_reads_the_truth_of_a_board_at_rest(chip):
    bus = open_simulated(f"sim:chip={chip},seed=3,rate_error_ppm=4000", gravity=9.82)
    truth = bus.truth_document()
    recording = session(bus, 15)
    assert not recording.gap.any()
    assert recording.rate_hz == pytest.approx(200 * 1.004, rel=2e-4)
    assert recording.temperature_c.mean() == pytest.approx(truth["temperature_c"], abs=0.05)
    flat = recording.t > recording.t[0] + 5
    expected = np.array(truth["D"])[:, 2] * 9.82 + truth["b_a"]
    np.testing.assert_allclose(recording.acc[flat].mean(axis=0), expected, atol=0.006)
    np.testing.assert_allclose(recording.gyr[flat].mean(axis=0), truth["b_omega"], atol=2e-4)
