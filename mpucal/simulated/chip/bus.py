"""Bus to a simulated chip: its clock, the duration of its transfers, and their faults."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...chip.access import Reply
from ...chip.registers import ADDRESSES
from ...mavlink.texts import Prompt
from ...sources.host_bus import transfer_error
from ...sources.usb_i2c import I2C_HZ
from ..faults import Fault, FaultKind, Schedule
from ..motion import Motion
from ..sensor import SensorTruth
from .chip import Chip


class FastClock:
    """Time in ns since the bus was opened, which only waiting moves on: waits return at once, each run is the same."""

    def __init__(self) -> None:
        self._now = 0

    def now(self) -> int:
        """Return the time."""
        return self._now

    def spend(self, ns: int) -> None:
        """Move on by `ns`."""
        self._now += ns

    def sleep_until(self, t_ns: int) -> None:
        """Move on to `t_ns`."""
        self._now = max(self._now, t_ns)


class RealClock:
    """Clock of the time since it was made, which sleeps."""

    def __init__(self) -> None:
        self._opened = time.monotonic_ns()
        self._busy_until = 0

    def now(self) -> int:
        """Return the time; during a transfer, the time of its end."""
        return max(self._busy_until, self._passed())

    def spend(self, ns: int) -> None:
        """Keep the bus busy for `ns`."""
        self._busy_until = self.now() + ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until `t_ns`."""
        time.sleep(max(0, t_ns - self._passed()) * 1e-9)

    def _passed(self) -> int:
        return time.monotonic_ns() - self._opened


SimulatedClock = FastClock | RealClock
CLOCKS: dict[str, type[SimulatedClock]] = {"fast": FastClock, "real": RealClock}


class FaultInjector:
    """Injector of the faults of one bus.

    Parameters
    ----------
    faults : each with its time. chip, clock : that they affect. rng : of the bits that flip.
    """

    def __init__(self, faults: Sequence[Fault], chip: Chip, clock: SimulatedClock, rng: np.random.Generator) -> None:
        self._faults, self._chip, self._clock, self._rng = faults, chip, clock, rng
        self._schedule = Schedule(faults)
        self._failing = [fault for fault in faults if fault.kind.errno is not None]
        self._flipping = [fault for fault in faults if fault.kind.flips]
        self._altering = [fault.kind.alters for fault in faults if fault.kind.alters is not None]
        for fault in faults:
            if fault.kind.pins is not None:
                chip.hold_words(*fault.kind.pins)

    def before_transfer(self) -> None:
        """Inject the faults that are due before a transfer.

        Raises
        ------
        OSError : the transfer fails.
        """
        while due := self._schedule.due(self._clock.now()):
            for fault in due:
                self._begin_fault(fault)
        for kind in self._active(self._failing):
            if kind.errno is not None and (not kind.share or self._rng.random() < kind.share):
                self._clock.spend(round(kind.takes_s * 1e9))
                raise OSError(kind.errno, os.strerror(kind.errno))

    def flip_bits(self, data: bytes) -> bytes:
        """Return `data`, sent in either direction, with the bits flipped that are flipped now."""
        share = max((kind.share for kind in self._active(self._flipping)), default=0.0)
        if not share:
            return data
        hit = self._rng.random(len(data)) < share
        flipped = np.frombuffer(data, np.uint8) ^ np.where(hit, 1 << self._rng.integers(0, 8, len(data)), 0)
        return flipped.astype(np.uint8).tobytes()

    def alter_reply(self, register: int, data: bytes) -> bytes:
        """Return the bytes that are read instead of `data` from `register` on."""
        for alter in self._altering:
            data = alter(register, data)
        return data

    def names(self) -> list[str]:
        """Return each fault as in an option."""
        return [str(fault) for fault in self._faults]

    def _begin_fault(self, fault: Fault) -> None:
        self._clock.spend(round(fault.kind.pause_s * 1e9))
        if fault.kind.begin is not None:
            now_ns = self._clock.now()
            end_ns = max(fault.end_ns, now_ns) if math.isfinite(fault.end_ns) else now_ns
            fault.kind.begin(self._chip, now_ns, round(end_ns))

    def _active(self, faults: Sequence[Fault]) -> list[FaultKind]:
        """Return the kinds of those of `faults` that last now."""
        if not faults:
            return []
        now_ns = self._clock.now()
        return [fault.kind for fault in faults if fault.begin_ns <= now_ns < fault.end_ns]


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
        khz: float = I2C_HZ / 1000,
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

    def hear(self, prompt: Prompt) -> None:
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
                raise transfer_error(error, "the simulated bus", ADDRESSES[0]) from error
        return self._clock.now()

    def _transmitted(self, data: bytes) -> bytes:
        return data if self._faults is None else self._faults.flip_bits(data)
