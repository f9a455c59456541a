"""A chip made to measure for a moment and put back as it was, without the reset that would reload its trim.

It reads the data registers; the FIFO is not touched.
"""

from __future__ import annotations

from contextlib import suppress
from types import TracebackType
from typing import Self

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import BusError, ChipError, ChipReset
from ..rests.stillness import let_go
from . import registers as reg
from .port import Port

MS = 1_000_000
WAKE_NS, SETTLE_NS = 100 * MS, 100 * MS
LOOK_NS, LOOKS = 5 * MS, 100

AFS_SEL, DLPF_CFG, SMPLRT_DIV = 1, 3, 4
# in the order of writing: awake first
SETTING = {
    reg.PWR_MGMT_1: reg.CLKSEL_PLL,
    reg.PWR_MGMT_2: 0,
    reg.SMPLRT_DIV: SMPLRT_DIV,
    reg.CONFIG: DLPF_CFG,
    reg.ACCEL_CONFIG: AFS_SEL << reg.FULL_SCALE_SHIFT,
}
# a person needs some time to put the board down
PATIENCE = 40
HALF_SENSITIVITY_G = 0.75


class TemporaryMeasurement:
    """For a `with` statement; what it changes is put back in the end, if the bus still works.

    Parameters
    ----------
    port : the chip's. patience : how many times to look, 0.6 s each, whether the board lies still.
    """

    def __init__(self, port: Port, patience: int = PATIENCE) -> None:
        self._port = port
        self._patience = patience
        self._held: dict[int, int] = {}
        self._sensitivity: float | None = None

    def __enter__(self) -> Self:
        self._held = {register: self._port.read(register, 1)[0] for register in SETTING}
        try:
            self._port.write(reg.PWR_MGMT_1, reg.CLKSEL_PLL)
            self._port.sleep(WAKE_NS)
            for register, value in SETTING.items():
                self._port.write(register, value)
            self._port.sleep(SETTLE_NS)
        except BaseException:
            self._put_back()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._put_back()

    def rest(self) -> Vector:
        """(3,) g of the accelerometer at rest, from a hundred looks; waits for a board that moves to be put down.

        Raises
        ------
        BusError : a transfer failed three times. ChipReset : the chip was reset. ChipError : the board moves on and on.
        """
        for _ in range(self._patience):
            self._port.sleep(SETTLE_NS)
            looks = self._looks()
            check_registers(self._port, reg.ACCEL_CONFIG, bytes([SETTING[reg.ACCEL_CONFIG]]))
            # revision C of the 6050 shows half of gravity; known once, offsets may shift what is shown
            sensitivity = self._sensitivity or (0.5 if np.linalg.norm(looks.mean(0)) < HALF_SENSITIVITY_G else 1.0)
            looks /= sensitivity
            if let_go(looks * STANDARD_GRAVITY_MPS2):
                self._sensitivity = self._sensitivity or sensitivity
                return np.asarray(looks.mean(0))
        moves_mg = 1000 * looks.std(0).max()
        raise ChipError(f"the board moves (by {moves_mg:.0f} mg)", "put it on a firm surface and let go of it")

    def _looks(self) -> Vector:
        """(n, 3) g at the nominal sensitivity."""
        looks = np.empty((LOOKS, 3))
        for look in looks:
            self._port.sleep(LOOK_NS)
            look[:] = np.frombuffer(self._port.read(reg.ACCEL_XOUT_H, 6), ">i2")
        return looks / reg.ACCEL_LSB_PER_G[AFS_SEL]

    def _put_back(self) -> None:
        # in the other order: asleep last
        for register, value in reversed(self._held.items()):
            with suppress(BusError):
                self._port.write(register, value)


def check_registers(port: Port, register: int, value: bytes) -> None:
    """Raise ChipReset where the registers from `register` on no longer hold `value`; one bit may flip on the bus."""
    if all(port.read(register, len(value)) != value for _ in range(2)):
        raise ChipReset
