"""The accelerometer alone at 4 kHz: what a 6500 does, what a 6050 cannot, and what a bus is too slow for."""

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, ChipError
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.faults import OF_CHIP, kinds
from mpucal.sources.tap import Tap

ALONE = Config(rate_hz=4000)


@pytest.mark.parametrize("model", ["mpu6500", "mpu6880", "clone98", "icm20602"])
def test_no_sample_is_lost(bench, stream, numbers, model):
    desk = bench(model)
    driver = desk.driver(ALONE)
    sensor = driver.start()
    assert (sensor.rate_hz, sensor.gyro_range_dps) == (4000, None)
    samples = stream(driver, 1.0)
    assert len(samples) == pytest.approx(4000 * 1.003, abs=40)
    assert (np.diff(numbers(samples)) == 1).all()
    assert not samples.gap.any()


def test_the_gyroscope_is_off_and_nothing_is_made_up_for_it(bench, stream):
    desk = bench("mpu6500")
    driver = desk.driver(ALONE)
    driver.start()
    samples = stream(driver, 0.2)
    assert np.isnan(samples.gyr).all()
    assert not samples.gyr_clipped.any()
    held = {register: data[-1] for register, data in desk.accesses("write")}
    assert held[reg.PWR_MGMT_2] == reg.STANDBY_GYRO
    assert held[reg.ACCEL_CONFIG2] & ~reg.FIFO_SIZE == reg.ACCEL_FCHOICE_B
    assert held[reg.FIFO_EN] == reg.FIFO_EN_ACCEL
    # the temperature is that of the register as the FIFO started
    assert driver.recording().sensor.temperature_c == pytest.approx(-2000 / 333.87 + 21)


def test_a_capture_of_it_gives_the_same(bench, stream):
    desk = bench("mpu6500")
    driver = desk.driver(ALONE)
    driver.start()
    stream(driver, 0.3)
    live, offline = driver.recording(), decode(desk.transactions)
    assert live.sensor == offline.sensor
    assert np.array_equal(live.t, offline.t)
    assert np.array_equal(live.acc, offline.acc)
    assert live.rate_hz == pytest.approx(4012, rel=1e-3)


def test_a_6050_is_not_so_fast(bench):
    with pytest.raises(ChipError, match=r"the accelerometer of the MPU-6050 measures 1000 times a second at most"):
        bench("mpu6050").driver(ALONE).start()


def test_the_filter_at_8_khz_is_divided_in_a_6050_alone(bench, stream):
    config = Config(dlpf=0)
    driver = bench("mpu6050").driver(config)
    driver.start()
    assert stream(driver, 0.5).t.size == pytest.approx(100, abs=12)
    with pytest.raises(ChipError, match=r"takes 8000 samples a second with its filter at 0: take 1 to 6"):
        bench("mpu6500").driver(config).start()


@pytest.mark.parametrize(("config", "khz"), [(ALONE, 100), (Config(rate_hz=1000), 100)], ids=["4 kHz", "1 kHz"])
def test_a_bus_that_is_too_slow_is_told(config, khz):
    driver = Driver(open_simulated(f"sim:chip=mpu6500,hand=still,khz={khz}"), config)
    driver.start()
    with pytest.raises(BusError, match=r"the bus moves \d+ samples a second, where .*: run it at 400 kHz"):
        for _ in range(1000):
            driver.poll()


def test_a_host_that_is_late_does_not_make_the_bus_slow(bench):
    desk = bench("mpu6500")
    driver = desk.driver(ALONE)
    driver.start()
    for _ in range(10):
        driver.poll()
        desk.stall(0.2)
        driver.poll()
        driver.poll()
    assert driver.recording().gap.sum() == 10


@pytest.mark.parametrize("fault", sorted(set(kinds(*OF_CHIP)) - {"stuck", "unplugged", "bitflips", "high_bit"}))
def test_what_passes_leaves_samples_that_follow_each_other(fault):
    records = []
    bus = open_simulated(f"sim:chip=mpu6500,hand=still,rate_error_ppm=0,fault={fault}@1.7")
    driver = Driver(Tap(bus, _Kept(records)), ALONE)
    driver.start()
    while driver.now_ns() < 4.5e9:
        driver.poll()
    recording = driver.recording()
    steps = np.diff(recording.t) * 4000
    assert steps.min() > 0
    assert steps[~recording.gap[1:]].max() < 1.5
    assert np.abs(np.linalg.norm(recording.acc, axis=1) - 9.8).max() < 2.5
    assert np.array_equal(decode(records).acc, recording.acc)


class _Kept:
    def __init__(self, records):
        self.transaction = records.append
