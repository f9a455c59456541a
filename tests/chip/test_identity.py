"""Identification of chips by their behaviour, and the refusal of foreign ones."""

import itertools

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.access import Reply
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.errors import ChipError


@pytest.mark.parametrize(
    ("chip", "who_am_i", "behaves"),
    [
        pytest.param("mpu6050", 0x68, "MPU-6050", id="a 6050"),
        pytest.param("mpu6050", 0x70, "MPU-6050", id="a 6050 that answers as a 6500"),
        pytest.param("mpu6050", 0x17, "MPU-6050", id="an unknown clone of a 6050"),
        pytest.param("mpu6050c", 0x68, "MPU-6050C", id="of revision C"),
        pytest.param("mpu6500", 0x68, "MPU-6500", id="a 6500 that answers as a 6050"),
        pytest.param("mpu6500", 0x71, "MPU-9250", id="a 9250 with a larger FIFO"),
        pytest.param("mpu6500_512", 0x72, "MPU-6500", id="an unknown clone of a 6500"),
        pytest.param("mpu6880", 0x72, "MPU-6880", id="a 6880"),
        pytest.param("clone98", 0x68, "ICM-20689", id="the 0x98 clone as a 6050"),
        pytest.param("icm20690", 0x20, "ICM-20690", id="a 20690"),
        pytest.param("icm20602", 0x68, "ICM-20602", id="a 20602 that answers as a 6050"),
        pytest.param("mpu6886", 0x72, "MPU-6886", id="a 6886"),
    ],
)
def test_a_simulated_chip_is_identified_by_its_behaviour(chip, who_am_i, behaves, same, tapped):
    """Decoding its capture gives the same; gravity, temperature and rate are the simulated ones."""
    bus, transactions = tapped(f"sim:seed=4,chip={chip},noise=0,b_a=0/0/0,temperature_c=30,who_am_i={who_am_i}")
    driver = Driver(bus, Config(accel_range_g=8))
    sensor = driver.start()
    for _ in range(20):
        driver.poll()
    recording = driver.recording()
    assert sensor.chip == behaves
    assert sensor.accel_range_g == 8
    assert np.linalg.norm(recording.acc, axis=1).mean() == pytest.approx(9.8, abs=0.5)
    assert recording.temperature_c.mean() == pytest.approx(30, abs=0.1)
    assert same(decode(transactions), recording)


class ForeignChip:
    """Chip that is not an MPU: 128 registers, as given."""

    def __init__(self, registers):
        self.registers, self.writes = registers, 0

    def read(self, register, count):
        return Reply(bytes(self.registers.get((register + i) % 0x80, 0) for i in range(count)), 0)

    def write(self, register, data):
        self.writes += 1
        return 0

    def sleep_until(self, t_ns):
        pass


def clock_chip(wrap, identity=0x25):
    """Registers of 23:59:45 on Saturday, December 31st, then memory, repeated after `wrap` registers."""
    time = [0x45, 0x59, 0x23, 0x07, 0x31, 0x12, 0x99]
    registers = {i: time[i % wrap] if i % wrap < 7 else identity for i in range(128)}
    return registers | {reg.WHO_AM_I: identity, reg.FIFO_COUNT_H: 0, reg.PWR_MGMT_1: 0}


@pytest.mark.parametrize(
    ("registers", "says"),
    [
        pytest.param(
            clock_chip(0x40), "is a real-time clock .*DS1307 or DS3231.*AD0 to VCC .* --address 0x69", id="RTC"
        ),
        pytest.param(clock_chip(0x13), "is a real-time clock", id="a DS3231"),
        pytest.param({reg.WHO_AM_I: 0x61, reg.PWR_MGMT_1: 0xA5}, "0x61 .* does not have an MPU's", id="another chip"),
        pytest.param({reg.WHO_AM_I: 0x61, reg.FIFO_COUNT_H: 0x80}, "0x61 .* does not have an MPU's", id="no FIFO"),
        pytest.param({}, "every register reads 0x00: SDA stays low", id="nothing but zeros"),
        pytest.param(
            dict.fromkeys(range(128), 0xFF), "every register reads 0xff: nothing drives SDA", id="nothing but ones"
        ),
    ],
)
def test_a_foreign_chip_is_refused_by_reading_alone(registers, says):
    foreign = ForeignChip(registers)
    with pytest.raises(ChipError, match=says):
        Driver(foreign).start()
    assert foreign.writes == 0


def test_a_known_part_whose_fifo_never_fills_is_refused():
    foreign = ForeignChip({reg.WHO_AM_I: 0x68, reg.PWR_MGMT_1: 0x01})
    counts, read = itertools.count(1), foreign.read

    def restless(register, count):
        foreign.registers[reg.FIFO_COUNT_H + 1] = next(counts)
        return read(register, count)

    foreign.read = restless
    with pytest.raises(ChipError, match="FIFO does not fill as its register map says"):
        Driver(foreign).start()
