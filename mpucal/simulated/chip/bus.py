"""The bus to a simulated chip, with the time its transfers take and the faults they meet."""

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
    """A Bus with a chip on it; its clock starts at 0.

    Parameters
    ----------
    chip : the only one on it. clock : its time.
    motion, truth : what moves the chip's sensor and what is true of it; None for a recording's counts.
    faults : what goes wrong with chip and bus. khz : how fast it moves bits.
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
        """Whether its time passes by itself."""
        return isinstance(self._clock, RealClock)

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on, and when the read began.

        Raises
        ------
        EndOfCapture : the recording behind the chip has ended. BusError : a fault, as Linux would tell it.
        """
        t_ns = self._begun()
        data = self._arriving(self._chip.read(register, count, t_ns))
        if self._faults is not None:
            data = self._faults.answered(register, data)
        # two addresses and the register, start, repeated start and stop, then the data
        self._clock.spend((27 + 3 + 9 * count) * self._bit_ns)
        return Reply(data, t_ns)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return when that began.

        Raises
        ------
        BusError : a fault, as Linux would tell it.
        """
        t_ns = self._begun()
        self._chip.write(register, self._arriving(data), t_ns)
        self._clock.spend((18 + 2 + 9 * len(data)) * self._bit_ns)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the clock shows `t_ns`."""
        self._clock.sleep_until(t_ns)

    def close(self) -> None:
        """Nothing to let go of."""

    def hear(self, prompt: HandPrompt) -> None:
        """The hand that holds the board hears `prompt` now; a recording hears nothing."""
        if self._motion is not None:
            self._motion.hear(prompt, self._clock.now() * 1e-9)

    def truth_document(self) -> dict[str, Any] | None:
        """What is true of the sensor, and what goes wrong with it, in plain JSON types; None for a recording."""
        if self._truth is None:
            return None
        return self._truth.document() | ({} if self._faults is None else {"faults": self._faults.words()})

    def _begun(self) -> int:
        """When a transfer begins that may go on."""
        if self._faults is not None:
            try:
                self._faults.before_transfer()
            except OSError as error:
                raise transfer_error(error, NAME, ADDRESS) from error
        return self._clock.now()

    def _arriving(self, data: bytes) -> bytes:
        return data if self._faults is None else self._faults.arriving(data)
