"""The bus to a simulated chip, with the time its transfers take. Knows no register."""

from __future__ import annotations

from typing import Any

from ...chip.access import Reply
from .chip import Chip
from .clock import Clock
from .hand import Prompt
from .motion import Motion
from .sensor import Truth

BIT_NS = 2500  # at 400 kHz


class SimulatedBus:
    """A Bus with a chip on it; its clock starts at 0.

    Parameters
    ----------
    chip : the only one on it. clock : its time.
    motion, truth : what moves the chip's sensor and what is true of it; None for a recording's counts.
    """

    def __init__(self, chip: Chip, clock: Clock, motion: Motion | None = None, truth: Truth | None = None) -> None:
        self._chip, self._clock, self._motion, self._truth = chip, clock, motion, truth

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on, and when the read began.

        Raises
        ------
        EndOfCapture : the recording behind the chip has ended.
        """
        t_ns = self._clock.now()
        data = self._chip.read(register, count, t_ns)
        # two addresses and the register, start, repeated start and stop, then the data
        self._clock.spend((27 + 3 + 9 * count) * BIT_NS)
        return Reply(data, t_ns)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return when that began."""
        t_ns = self._clock.now()
        self._chip.write(register, data, t_ns)
        self._clock.spend((18 + 2 + 9 * len(data)) * BIT_NS)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Wait until the clock shows `t_ns`."""
        self._clock.sleep_until(t_ns)

    def close(self) -> None:
        """Nothing to let go of."""

    def hear(self, prompt: Prompt) -> None:
        """The hand that holds the board hears `prompt` now; a recording hears nothing."""
        if self._motion is not None:
            self._motion.hear(prompt, self._clock.now() * 1e-9)

    def truth_document(self) -> dict[str, Any] | None:
        """What is true of the sensor, in plain JSON types; None for a recording."""
        return None if self._truth is None else self._truth.document()
