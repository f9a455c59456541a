"""Open chip on a bus: its driver measures, and every access is recorded; or its registers are read as they are.

Source: RM-MPU-6000A r4.2, registers 27, 28, 59 to 66, 107 and 117.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..chip import registers as reg
from ..chip.access import Bus
from ..chip.driver import Driver
from ..chip.families import PARTS
from ..chip.offsets import PLACES, OffsetRegisters
from ..chip.port import Port
from ..data import STANDARD_GRAVITY_MPS2
from ..files.messages import BUS
from ..origin import Origin
from .opened_source import ActiveSource, CaptureRecorder, OpenedSource, Say
from .replay import Tap

if TYPE_CHECKING:
    from .reading_process import BusDriver

CAN_FORK = sys.platform == "linux"


@dataclass
class OpenedChip(OpenedSource):
    """Chip on a bus, which is its `line`; see OpenedSource.

    Attributes
    ----------
    own_process : True to read its bus in a process of its own, as one whose FIFO does not wait for this program.
    """

    _: KW_ONLY
    own_process: bool = False
    origin = Origin.CHIP
    topic = BUS

    @property
    def bus(self) -> Bus:
        """Open bus."""
        bus: Bus = self.line
        return bus

    @property
    def where(self) -> str:
        """Description of the chip's place, for messages."""
        return f"the chip on {next(iter(self.words.values()), 'its bus')}"

    def contents(self) -> dict[str, Any]:
        """Read the registers; nothing is set up or written."""
        with closing(self.bus):
            return {"where": self.where, **chip_contents(self.bus)}

    def driver(self, bus: Any, name: str, say: Say) -> BusDriver:
        """Make the driver that measures over `bus`."""
        return Driver(bus, self.plan.config, name, say)

    @contextmanager
    def recorded(self, recorder: CaptureRecorder, name: str, say: Say) -> Iterator[ActiveSource]:
        """See OpenedSource."""

        tap = Tap(self.bus, recorder.transaction)

        def tell(text: str) -> None:
            # The process that reads shows nothing.
            if tap.record == recorder.transaction:
                say(f"  {text}.")

        driver, event = self.driver(tap, name, tell), recorder.event
        if not (self.own_process and CAN_FORK):
            yield ActiveSource(driver, event)
            return
        from .reading_process import ProcessSource  # noqa: PLC0415 - only for a sensor that does not wait

        with closing(ProcessSource(driver, tap, self.parts, self.hands)) as source:
            self.hands = (source.hear,)
            yield ActiveSource(source, event)


def chip_contents(bus: Bus) -> dict[str, Any]:
    """Read identity, ranges, offset registers and, if the chip is known and awake, one sample (m/s^2, deg C).

    The values are of JSON's types.

    Raises
    ------
    BusError : a transfer failed.
    """
    port = Port(bus)
    who_am_i = port.read(reg.WHO_AM_I, 1)[0]
    gyro, accel = port.read(reg.GYRO_CONFIG, 2)
    asleep = bool(port.read(reg.PWR_MGMT_1, 1)[0] & reg.PWR_MGMT_1_SLEEP)
    part = PARTS.get(who_am_i)
    shift = reg.FULL_SCALE_SHIFT if part is None else part.family.gyro_range_shift
    scale = accel >> reg.FULL_SCALE_SHIFT & reg.FULL_SCALE_CODES
    facts: dict[str, Any] = {
        "who_am_i": who_am_i,
        "chip": None if part is None else part.chip,
        "asleep": asleep,
        "accel_range_g": reg.ACCEL_RANGES_G[scale],
        "gyro_range_dps": reg.GYRO_RANGES_DPS[gyro >> shift & reg.FULL_SCALE_CODES],
        "accel_offsets": {f"0x{place[0]:02x}": list(OffsetRegisters.read(port, place).words) for place in PLACES},
    }
    if asleep or part is None:
        return facts
    # The accelerometer's six bytes, then two of the temperature.
    data = np.frombuffer(port.read(reg.ACCEL_XOUT_H, 8), ">i2").astype(float)
    acc = data[:3] / reg.ACCEL_LSB_PER_G[scale] * STANDARD_GRAVITY_MPS2 / part.accel_sensitivity
    return facts | {
        "acc_mps2": acc.tolist(),
        "temperature_c": float(data[3] / part.family.lsb_per_c + part.family.zero_c),
    }
