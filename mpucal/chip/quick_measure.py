"""Measurement of the accelerometer at rest from the data registers, after which the chip is as it was before.

The chip is not reset, which would reload its trim, and the FIFO is not touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import BoardMoved, BusError, ChipReset
from ..rests.stillness import is_untouched
from . import registers as reg
from .identity import accel_sensitivity
from .losses import Loss
from .port import Port
from .setup import STARTUP_NS

READ_NS, READS = 5_000_000, 100

AFS_SEL, DLPF_CFG, SMPLRT_DIV = 1, 3, 4
# In the order of writing: the chip must be awake first.
SETTING = {
    reg.PWR_MGMT_1: reg.CLKSEL_PLL,
    reg.PWR_MGMT_2: 0,
    reg.SMPLRT_DIV: SMPLRT_DIV,
    reg.CONFIG: DLPF_CFG,
    reg.ACCEL_CONFIG: AFS_SEL << reg.FULL_SCALE_SHIFT,
}
# Tries until the board must lie still, 0.6 s each: a person needs some time to put it down.
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
            acc_g = read_counts(self._port, reg.ACCEL_WORDS) / reg.ACCEL_LSB_PER_G[AFS_SEL]
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
        port.sleep(READ_NS)
        row[:] = np.frombuffer(port.read(reg.ACCEL_XOUT_H, 2 * words), ">i2")
    return counts


def check_registers(port: Port, register: int, value: bytes) -> None:
    """Raise ChipReset if two reads from `register` on do not give `value`: a single one may have a bit error."""
    if all(port.read(register, len(value)) != value for _ in range(2)):
        raise ChipReset("the chip lost its settings during the measurement: it was reset", Loss.RESET.remedy)
