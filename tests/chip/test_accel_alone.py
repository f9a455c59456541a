"""The accelerometer alone at 4 kHz on a 6500; a 6050 refuses it, and so does a bus that is too slow."""

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, ChipError
from mpucal.simulated.chip import open_simulated

ALONE = Config(rate_hz=4000)


@pytest.mark.parametrize("model", ["mpu6500", "icm20602"])
def test_no_sample_is_lost(rig, stream, numbers, model):
    driver = rig(model).driver(ALONE)
    sensor = driver.start()
    assert (sensor.rate_hz, sensor.gyro_range_dps) == (4000, None)
    samples = stream(driver, 1.0)
    assert len(samples) == pytest.approx(4000 * 1.003, abs=40)
    assert (np.diff(numbers(samples)) == 1).all()
    assert not samples.gap.any()


def test_the_gyroscope_is_off_and_its_rates_are_nan(started, stream, same):
    rig, driver = started("mpu6500", ALONE)
    samples = stream(driver, 0.3)
    assert np.isnan(samples.gyr).all()
    assert not samples.gyr_clipped.any()
    held = {register: data[-1] for register, data in rig.writes()}
    assert held[reg.PWR_MGMT_2] == reg.STANDBY_GYRO
    assert held[reg.ACCEL_CONFIG2] & ~reg.FIFO_SIZE == reg.ACCEL_FCHOICE_B
    assert held[reg.FIFO_EN] == reg.FIFO_EN_ACCEL
    live, offline = driver.recording(), decode(rig.transactions)
    # the register's temperature as the FIFO started
    assert live.sensor.temperature_c == pytest.approx(-2000 / 333.87 + 21)
    assert live.rate_hz == pytest.approx(4012, rel=1e-3)
    assert live.sensor == offline.sensor
    assert np.array_equal(live.t, offline.t)
    assert np.array_equal(live.acc, offline.acc)


def test_a_6050_does_not_measure_at_4_khz(rig):
    with pytest.raises(ChipError, match=r"the accelerometer of the MPU-6050 measures 1000 times a second at most"):
        rig("mpu6050").driver(ALONE).start()


def test_only_a_6050_divides_the_rate_of_8_khz(started, stream):
    config = Config(dlpf=0)
    assert stream(started("mpu6050", config)[1], 0.5).t.size == pytest.approx(100, abs=12)
    with pytest.raises(ChipError, match=r"takes 8000 samples a second with its filter at 0: set the filter to 1 to 6"):
        started("mpu6500", config)


@pytest.mark.parametrize("config", [ALONE, Config(rate_hz=1000)], ids=["4 kHz", "1 kHz"])
def test_a_bus_that_is_too_slow_is_reported(config, stream):
    driver = Driver(open_simulated("sim:chip=mpu6500,hand=still,khz=100"), config)
    driver.start()
    with pytest.raises(BusError, match=r"the bus moves \d+ samples a second, but .*: run the bus at 400 kHz"):
        stream(driver, 10)


def test_a_late_host_does_not_count_as_a_slow_bus(started):
    rig, driver = started("mpu6500", ALONE)
    for _ in range(10):
        driver.poll()
        rig.stall(0.2)
        driver.poll()
        driver.poll()
    assert driver.recording().gap.sum() == 10


@pytest.mark.parametrize("fault", ["bit_errors", "brownout", "nack", "slip"])
def test_a_passing_fault_leaves_valid_samples(fault, tapped):
    bus, transactions = tapped(f"sim:chip=mpu6500,hand=still,rate_error_ppm=0,fault={fault}@1.7")
    driver = Driver(bus, ALONE)
    driver.start()
    while driver.now_ns() < 4.5e9:
        driver.poll()
    recording = driver.recording()
    steps = np.diff(recording.t) * 4000
    assert steps.min() > 0
    assert steps[~recording.gap[1:]].max() < 1.5
    assert np.abs(np.linalg.norm(recording.acc, axis=1) - 9.8).max() < 2.5
    assert np.array_equal(decode(transactions).acc, recording.acc)
