"""Measurement of the accelerometer at rest from the data registers, after which the chip is as it was before.

The chip is not reset, which would reload its trim, and the FIFO is not touched. The factory's self test is such a
measurement, too: a built-in force pushes each axis, and the response is compared with the factory's code. Source of the
self test: RM-MPU-6000A r4.2, registers 13 to 16, 27 and 28, and PS-MPU-6000A r3.4, sections 6.1 and 6.2 (within 14 %);
for the 6500 RM-MPU-9250A r1.4, registers 0 to 15, with the limits of Linux' drivers/iio/imu/inv_mpu6050.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector, Whole
from ..errors import BoardMoved, BusError, ChipReset
from ..rests.stillness import is_untouched
from . import registers as reg
from .config import Config
from .families import Part
from .identity import accel_sensitivity
from .losses import Loss
from .port import Port
from .setup import STARTUP_NS

READS = 100

# The settings are those of a session, in the order of writing: the chip must be awake first.
AFS_SEL = reg.ACCEL_RANGES_G.index(Config.accel_range_g)
SETTING = {
    reg.PWR_MGMT_1: reg.CLKSEL_PLL,
    reg.PWR_MGMT_2: 0,
    reg.SMPLRT_DIV: reg.sample_rate_divider(Config.rate_hz, Config.dlpf),
    reg.CONFIG: Config.dlpf,
    reg.ACCEL_CONFIG: AFS_SEL << reg.FULL_SCALE_SHIFT,
}
# Tries until the board must lie still, 0.6 to 1 s each: a person needs some time to put it down.
PATIENCE = 40


@contextmanager
def temporary_measurement(port: Port, patience: int = PATIENCE) -> Iterator[TemporaryMeasurement]:
    """Set the chip to measure during a `with` block, and restore its settings at the end if the bus still works.

    Parameters
    ----------
    patience : number of tries until the board must lie still.
    """
    old = {register: port.read(register, 1)[0] for register in SETTING}
    try:
        port.write(reg.PWR_MGMT_1, reg.CLKSEL_PLL)
        port.sleep(STARTUP_NS)
        for register, value in SETTING.items():
            port.write(register, value)
        port.sleep(STARTUP_NS)
        yield TemporaryMeasurement(port, patience)
    finally:
        # In reverse order: the chip falls asleep last.
        for register, value in reversed(old.items()):
            with suppress(BusError):
                port.write(register, value)


class TemporaryMeasurement:
    """Chip that `temporary_measurement` has set to measure."""

    def __init__(self, port: Port, patience: int) -> None:
        self._port, self._patience = port, patience
        self._sensitivity: float | None = None

    def rest(self) -> Vector:
        """Measure the accelerometer at rest (3,) [g], from a hundred reads; wait for a moving board to be put down.

        Raises
        ------
        BusError : a transfer failed three times. ChipReset : the chip was reset. ChipError : the board does not rest.
        """
        for _ in range(self._patience):
            self._port.sleep(STARTUP_NS)
            acc_g = read_counts(self._port, words=3) / reg.ACCEL_LSB_PER_G[AFS_SEL]
            check_registers(self._port, reg.ACCEL_CONFIG, bytes([SETTING[reg.ACCEL_CONFIG]]))
            # Revision C of the 6050 shows half of gravity. It is measured once, since offsets may shift the reading.
            sensitivity = self._sensitivity or accel_sensitivity(float(np.linalg.norm(acc_g.mean(0))))
            acc_g /= sensitivity
            if is_untouched(acc_g * STANDARD_GRAVITY_MPS2):
                self._sensitivity = self._sensitivity or sensitivity
                return np.asarray(acc_g.mean(0))
        moves_mg = 1000 * acc_g.std(0).max()
        raise BoardMoved(f"the board moves (by {moves_mg:.0f} mg)", "put it on a firm surface and let go of it")


def read_counts(port: Port, words: int) -> Vector:
    """Read the first `words` words of a sample, the accelerometer's first; return (READS, words) counts."""
    counts = np.empty((READS, words))
    for row in counts:
        port.sleep(round(1e9 / Config.rate_hz))
        row[:] = np.frombuffer(port.read(reg.ACCEL_XOUT_H, 2 * words), ">i2")
    return counts


def check_registers(port: Port, register: int, value: bytes) -> None:
    """Raise ChipReset if two reads from `register` on do not give `value`: a single one may have a bit error."""
    if all(port.read(register, len(value)) != value for _ in range(2)):
        raise ChipReset("the chip lost its settings during the measurement: it was reset", Loss.RESET.remedy)


SETTLE_NS = 250_000_000

PACKED_SHARES, ACCEL_SHARES, GYRO_SHARES = (0.86, 1.14), (0.5, 1.5), (0.5, np.inf)

# Number of attempts on a board that moves, and differences between the readings before and after that show it.
ATTEMPTS = 2
MOVED_G, MOVED_DPS = 0.02, 2.0


class SelfTest(NamedTuple):
    """Responses of the axes x, y, z.

    Attributes
    ----------
    accel_shares, gyro_shares : (3,) response divided by that of the factory's code; NaN without a code.
    passed : True if all are within the limits of the register map; False without codes.
    moved : the board was moved meanwhile, in each attempt: the shares mean nothing.
    """

    accel_shares: Vector
    gyro_shares: Vector
    passed: bool
    moved: bool

    @property
    def has_codes(self) -> bool:
        """True if the chip has all codes, as every genuine part has."""
        return bool(np.isfinite([self.accel_shares, self.gyro_shares]).all())


def run_self_test(port: Port, part: Part) -> SelfTest:
    """Test a chip that is awake and at rest, and restore its ranges.

    Raises
    ------
    BusError : a transfer failed three times. ChipReset : the chip was reset meanwhile.
    """
    ranges, family = port.read(reg.GYRO_CONFIG, 2), part.family
    # A reset clears the first two, or puts the chip to sleep.
    kept = [(register, port.read(register, 1)) for register in (reg.CONFIG, reg.SMPLRT_DIV, reg.PWR_MGMT_1)]
    # A 6050 is tested at +-8 g, a 6500 at +-2 g, and both at +-250 deg/s.
    afs_sel = reg.ACCEL_RANGES_G.index(8 if family.packed_self_test else 2)
    try:
        for _ in range(ATTEMPTS):
            off, on, after = (_mean_counts(port, test, afs_sel) for test in (0, reg.SELF_TEST, 0))
            change = np.abs(after - off)
            moved = bool(
                (change[:3] > MOVED_G * reg.ACCEL_LSB_PER_G[afs_sel]).any()
                or (change[4:] > MOVED_DPS * reg.GYRO_LSB_PER_DPS[0]).any()
            )
            if not moved:
                break
    finally:
        port.write_block(reg.GYRO_CONFIG, ranges)
        port.sleep(SETTLE_NS)
    for register, value in kept:
        check_registers(port, register, value)
    accel = (on - off)[:3] / (reg.ACCEL_LSB_PER_G[afs_sel] * part.accel_sensitivity)
    gyro = (on - off)[4:] / reg.GYRO_LSB_PER_DPS[0]
    codes = _factory_codes(port, family.packed_self_test)
    expected = factory_response(family.packed_self_test, *codes)
    shares = [np.where(code, each / of, np.nan) for code, each, of in zip(codes, (accel, gyro), expected, strict=True)]
    limits = (PACKED_SHARES, PACKED_SHARES) if family.packed_self_test else (ACCEL_SHARES, GYRO_SHARES)
    passed = all(((low < share) & (share < high)).all() for share, (low, high) in zip(shares, limits, strict=True))
    return SelfTest(shares[0], shares[1], passed, moved)


def _mean_counts(port: Port, test: int, afs_sel: int) -> Vector:
    """Measure the mean counts (7,) of a sample with these settings, at the gyroscope's smallest range."""
    port.write_block(reg.GYRO_CONFIG, bytes([test, afs_sel << reg.FULL_SCALE_SHIFT | test]))
    port.sleep(SETTLE_NS)
    return np.asarray(read_counts(port, reg.FRAME_WORDS).mean(0))


def _factory_codes(port: Port, packed: bool) -> tuple[Whole, Whole]:
    """Read the factory's codes (3,) of the accelerometer and of the gyroscope; 0: there is none."""
    if not packed:
        gyro, accel = (port.read(start, 3) for start in (reg.SELF_TEST_GYRO, reg.SELF_TEST_ACCEL))
        return np.array([*accel]), np.array([*gyro])
    *axes, low = port.read(reg.SELF_TEST_ACCEL, 4)
    accel_codes = [(axis >> 5) << 2 | low >> shift & 3 for axis, shift in zip(axes, (4, 2, 0), strict=True)]
    return np.array(accel_codes), np.array([axis & 0x1F for axis in axes])


def factory_response(packed: bool, accel: Whole, gyro: Whole) -> tuple[Vector, Vector]:
    """Return the factory's responses (3,) [g] and (3,) [deg/s] by its codes; those of 0 mean nothing."""
    a, w = (codes.astype(np.float64) - 1.0 for codes in (accel, gyro))
    if packed:
        return 0.34 * (0.92 / 0.34) ** (a / 30), 25.0 * 1.046**w * np.array([1.0, -1.0, 1.0])
    return 2620.0 * 1.01**a / reg.ACCEL_LSB_PER_G[0], 2620.0 * 1.01**w / reg.GYRO_LSB_PER_DPS[0]
