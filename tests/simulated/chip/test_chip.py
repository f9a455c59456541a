"""Registers, sample clock and FIFO of the simulated chip, compared with the register map."""

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.errors import EndOfCapture
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim

MS = 1_000_000
TRIM = (-1500, 2001, 700)
PIECE = FactoryTrim(TRIM, (13, 22, 31), (9, 1, 30), (0.4, 0.5, 0.6), (30.0, -40.0, 50.0))


class Counter:
    """Feed with the words 7 k, 7 k + 1, ... in sample k, which keeps the requested times and settings."""

    def __init__(self, end=None):
        self.next, self.end, self.settings, self.edges = 0, end, [], []

    def samples(self, edges_s, setting):
        self.settings.append(setting)
        self.edges.append(edges_s)
        n = len(edges_s) - 1
        if self.end is not None:
            n = min(n, self.end - self.next)
        rows = np.arange(7 * self.next, 7 * (self.next + n)).reshape(n, 7)
        self.next += n
        return rows.astype(np.int16)


def chip(model="mpu6050", feed=None, ppm=0.0):
    return Chip(MODELS[model], feed or Counter(), ppm, PIECE)


def collecting(device, divider=4, sources=0xF8, config=1):
    """Return the chip, awake at 1 kHz / (1 + divider) from 0 on, its FIFO on."""
    for register, value in (
        (reg.PWR_MGMT_1, 0x01),
        (reg.CONFIG, config),
        (reg.SMPLRT_DIV, divider),
        (reg.FIFO_EN, sources),
        (reg.USER_CTRL, reg.USER_CTRL_FIFO_EN),
    ):
        device.write(register, bytes([value]), 0)
    return device


def setting_after(*writes, model="mpu6050", **options):
    """Return the setting under which a chip measures after writes of (register, bytes)."""
    feed = Counter()
    device = chip(model, feed)
    for register, data in writes:
        device.write(register, data, 0)
    collecting(device, **options).read(reg.FIFO_R_W, 1, 10 * MS)
    return feed.settings[-1]


def word(value):
    return value.to_bytes(2, "big", signed=True)


def count(device, t_ns):
    return int.from_bytes(device.read(reg.FIFO_COUNT_H, 2, t_ns), "big")


def words(data):
    return np.frombuffer(data, ">i2").tolist()


@pytest.mark.parametrize(
    ("model", "register", "written", "kept"),
    [
        ("mpu6050", reg.PWR_MGMT_1, 0x80, 0x40),  # asleep after a reset
        ("mpu6500", reg.PWR_MGMT_1, 0x80, 0x01),  # awake
        ("mpu6050", reg.SMPLRT_DIV, 0x13, 0x13),
        ("mpu6050", reg.WHO_AM_I, 0x12, 0x68),
        ("mpu6050", 0x50, 0xFF, 0x00),  # no such register
        ("mpu6050", reg.ACCEL_CONFIG2, 0x03, 0x00),  # which the 6500 has
        ("mpu6500", reg.ACCEL_CONFIG2, 0x03, 0x03),
        ("mpu6050", reg.USER_CTRL, 0x45, 0x40),  # resets clear themselves
        ("mpu6500", 0x06, 0xFF, 0x00),  # an offset of the 6050
        ("mpu6500", 0x7E, 0xFE, 0xFE),  # one of the 6500
    ],
)
def test_registers_after_a_write(model, register, written, kept):
    device = chip(model)
    device.write(register, bytes([written]), 0)
    assert device.read(register, 1, 0) == bytes([kept])


@pytest.mark.parametrize(
    ("sources", "columns"),
    [(0xF8, [0, 1, 2, 3, 4, 5, 6]), (0x08, [0, 1, 2]), (0x78, [0, 1, 2, 4, 5, 6]), (0x80, [3]), (0x30, [5, 6])],
    ids=["all", "accelerometer", "without temperature", "temperature", "gyroscope y and z"],
)
def test_a_frame_holds_the_enabled_sources_in_register_order(sources, columns):
    device = collecting(chip(), sources=sources)
    assert count(device, 10 * MS) == 2 * 2 * len(columns)
    frames = device.read(reg.FIFO_R_W, 2 * 2 * len(columns), 10 * MS)
    assert words(frames) == columns + [7 + c for c in columns]


@pytest.mark.parametrize(
    ("model", "accel_config2", "size"),
    [("mpu6050", None, 1024), ("mpu6500", None, 512), ("clone98", None, 512), ("clone98", 0xC0, 4096)],
)
def test_overflow_drops_the_oldest_bytes_and_misaligns(model, accel_config2, size):
    device = chip(model)
    if accel_config2 is not None:
        device.write(reg.ACCEL_CONFIG2, bytes([accel_config2]), 0)
    collecting(device, divider=0)
    frames = size // 14 + 5
    assert count(device, frames * MS) == size
    assert device.read(reg.INT_STATUS, 1, frames * MS)[0] & reg.INT_FIFO_OFLOW
    everything = np.arange(7 * frames).astype(">i2").tobytes()
    assert device.read(reg.FIFO_R_W, size, frames * MS) == everything[-size:]
    assert size % 14 != 0


# a 6050's FIFO is not reset while it is on
@pytest.mark.parametrize(
    ("model", "value", "left"), [("mpu6050", 0x44, 28), ("mpu6050", 0x04, 0), ("mpu6500", 0x44, 0)]
)
def test_fifo_reset(model, value, left):
    device = collecting(chip(model))
    device.write(reg.USER_CTRL, bytes([value]), 11 * MS)
    assert count(device, 11 * MS) == left


# filters 0 and 7 have a base of 8 kHz
@pytest.mark.parametrize(("config", "divider", "rate_hz"), [(3, 4, 200.0), (0, 7, 1000.0), (7, 39, 200.0)])
def test_the_rate_follows_divider_and_filter(config, divider, rate_hz):
    assert setting_after(divider=divider, config=config).rate_hz == rate_hz


@pytest.mark.parametrize(("model", "address"), [("mpu6050", 0x08), ("mpu6500", 0x7A)])
def test_offset_registers_act_by_their_difference_from_the_factory_trim(model, address):
    feed = Counter()
    device = chip(model, feed)
    old = int.from_bytes(device.read(address, 2, 0), "big", signed=True)
    device.write(address, word(old + 256), 0)
    device.write(reg.XG_OFFSET_H, word(131), 0)
    collecting(device).read(reg.FIFO_R_W, 1, 5 * MS)
    setting = feed.settings[-1]
    assert setting.accel_offset_g == (0.0, 0.125, 0.0)
    assert setting.gyro_offset_dps == pytest.approx((4.0, 0.0, 0.0))
    device.write(reg.PWR_MGMT_1, b"\x80", 6 * MS)
    assert int.from_bytes(device.read(address, 2, 6 * MS), "big", signed=True) == old


def test_a_feed_that_ends_is_served_to_its_last_sample():
    device = collecting(chip(feed=Counter(end=5)))
    assert count(device, 20 * MS) == 4 * 14
    assert count(device, 90 * MS) == 5 * 14
    assert words(device.read(reg.FIFO_R_W, 5 * 14, 95 * MS)) == list(range(35))
    with pytest.raises(EndOfCapture):
        count(device, 100 * MS)


@pytest.mark.parametrize(
    ("model", "held"),
    [
        # x: 0b01101 and 9, y: 0b10110 and 1, z: 0b11111 and 30
        ("mpu6050", {0x0D: 0b011_01001, 0x0E: 0b101_00001, 0x0F: 0b111_11110, 0x10: 0b01_10_11}),
        ("mpu6500", {0x00: 9, 0x01: 1, 0x02: 30, 0x0D: 13, 0x0E: 22, 0x0F: 31}),
    ],
    ids=["packed", "a byte each"],
)
def test_the_factorys_self_test_codes(model, held):
    device = chip(model)
    assert {register: device.read(register, 1, 0)[0] for register in held} == held


@pytest.mark.parametrize("model", ["mpu6050", "mpu6500"])
def test_a_drawn_piece_answers_its_self_test_as_its_codes_say(model):
    family = MODELS[model].family
    for seed in range(20):
        piece = FactoryTrim.draw(np.random.default_rng(seed), family)
        for axis in range(3):
            accel, gyro = piece.accel_codes[axis], piece.gyro_codes[axis]
            if family.packed_self_test:
                expected = 0.34 * (0.92 / 0.34) ** ((accel - 1) / 30), (25, -25, 25)[axis] * 1.046 ** (gyro - 1)
            else:
                expected = 2620 * 1.01 ** (accel - 1) / 16384, 2620 * 1.01 ** (gyro - 1) / 131
            answered = piece.accel_self_test_g[axis], piece.gyro_self_test_dps[axis]
            assert np.divide(answered, expected) == pytest.approx([1, 1], abs=0.05)
            assert 0.2 < answered[0] < 1.0
