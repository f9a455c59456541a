"""Bus to a simulated chip, with the duration of its transfers and their faults."""

from __future__ import annotations

from typing import Any

from ...chip.access import Reply
from ...sources.i2c_errors import transfer_error
from ..hand import HandPrompt
from ..motion import Motion
from ..sensor import SensorTruth
from .chip import Chip
from .clock import RealClock, SimulatedClock
from .fault_injector import FaultInjector

KHZ = 400
NAME, ADDRESS = "the simulated bus", 0x68


class SimulatedBus:
    """Bus with one chip; its clock starts at 0.

    Parameters
    ----------
    chip, clock : of the bus.
    motion, truth : of the chip's sensor; None for a recording's counts.
    faults : of chip and bus. khz : bit rate.
    """

    def __init__(
        self,
        chip: Chip,
        clock: SimulatedClock,
        motion: Motion | None = None,
        truth: SensorTruth | None = None,
        faults: FaultInjector | None = None,
        khz: float = KHZ,
    ) -> None:
        self._chip, self._clock, self._motion, self._truth, self._faults = chip, clock, motion, truth, faults
        self._bit_ns = round(1e6 / khz)

    @property
    def real_time(self) -> bool:
        """True if its time passes by itself."""
        return isinstance(self._clock, RealClock)

    def read(self, register: int, count: int) -> Reply:
        """Read `count` bytes from `register` on; return them and the time at which the read began.

        Raises
        ------
        EndOfCapture : the recording behind the chip has ended. BusError : a fault, as Linux reports it.
        """
        t_ns = self._begin()
        data = self._transmitted(self._chip.read(register, count, t_ns))
        if self._faults is not None:
            data = self._faults.alter_reply(register, data)
        # Two addresses and the register, start, repeated start and stop, then the data.
        self._clock.spend((27 + 3 + 9 * count) * self._bit_ns)
        return Reply(data, t_ns)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on; return the time at which the write began.

        Raises
        ------
        BusError : a fault, as Linux reports it.
        """
        t_ns = self._begin()
        self._chip.write(register, self._transmitted(data), t_ns)
        self._clock.spend((18 + 2 + 9 * len(data)) * self._bit_ns)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the clock shows `t_ns`."""
        self._clock.sleep_until(t_ns)

    def close(self) -> None:
        """Do nothing: no device is open."""

    def hear(self, prompt: HandPrompt) -> None:
        """Pass a prompt to the hand; the bus of a recording ignores it."""
        if self._motion is not None:
            self._motion.hear(prompt, self._clock.now() * 1e-9)

    def truth_document(self) -> dict[str, Any] | None:
        """Return the sensor's true parameters and its faults in plain JSON types, None for a recording."""
        if self._truth is None:
            return None
        return self._truth.document() | ({} if self._faults is None else {"faults": self._faults.names()})

    def _begin(self) -> int:
        """Return the time at which a transfer begins, unless a fault prevents it."""
        if self._faults is not None:
            try:
                self._faults.before_transfer()
            except OSError as error:
                raise transfer_error(error, NAME, ADDRESS) from error
        return self._clock.now()

    def _transmitted(self, data: bytes) -> bytes:
        return data if self._faults is None else self._faults.flip_bits(data)
