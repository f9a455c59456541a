"""Faults of a simulated chip and its bus, by the bus's clock."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np

from ..faults import Fault, FaultKind, Schedule
from .chip import Chip
from .clock import SimulatedClock


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
                self._strike(fault)
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

    def _strike(self, fault: Fault) -> None:
        self._clock.spend(round(fault.kind.pause_s * 1e9))
        if fault.kind.strike is not None:
            now_ns = self._clock.now()
            end_ns = max(fault.end_ns, now_ns) if math.isfinite(fault.end_ns) else now_ns
            fault.kind.strike(self._chip, now_ns, round(end_ns))

    def _active(self, faults: Sequence[Fault]) -> list[FaultKind]:
        """Return the kinds of those of `faults` that last now."""
        if not faults:
            return []
        now_ns = self._clock.now()
        return [fault.kind for fault in faults if fault.begin_ns <= now_ns < fault.end_ns]
