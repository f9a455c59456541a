"""What goes wrong with a chip or its bus, as events at chosen times: one vocabulary for tests and for `sim:fault=`.

Knows no driver. What the kernel would say of a transfer is an OSError with the errno of Linux'
Documentation/i2c/fault-codes.rst.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from .chip import Chip
from .clock import Clock

FLIPPED_BYTES = 1 / 200  # how many bytes of a noisy bus arrive with one bit flipped


@dataclass(frozen=True)
class Kind:
    """One way to go wrong.

    Attributes
    ----------
    what : in a few words. seconds : how long it lasts.
    errno : with which every transfer fails meanwhile, if it does. takes_s : how long such a transfer takes.
    flips : bytes arrive with bits flipped meanwhile. pause_s : how long the host does nothing.
    strike : what happens to the chip at the given time [ns], and when it is over [ns].
    """

    what: str
    seconds: float = 0.0
    errno: int | None = None
    takes_s: float = 0.0
    flips: bool = False
    pause_s: float = 0.0
    strike: Callable[[Chip, int, int], None] | None = None


KINDS = {
    "nack": Kind("the chip does not acknowledge", 0.3, errno.EREMOTEIO),
    "timeout": Kind("a transfer does not end", 0.5, errno.ETIMEDOUT, takes_s=0.1),
    "overflow": Kind("the host sleeps, and the FIFO overflows", pause_s=2.0),
    "brownout": Kind(
        "the supply breaks down, and the chip resets", 0.05, errno.EREMOTEIO, strike=lambda chip, t, _: chip.reset(t)
    ),
    "stuck": Kind("a wire stays low", math.inf, errno.ETIMEDOUT, takes_s=0.1),
    "unplugged": Kind("a wire is pulled", math.inf, errno.EREMOTEIO),
    "bitflips": Kind("the bus is noisy", 0.5, flips=True),
    "clock": Kind("the sample clock runs 1 % faster from then on", strike=lambda chip, t, _: chip.hurry(1.01, t)),
    "frozen": Kind("the sensor repeats itself", 1.0, strike=lambda chip, _, end: chip.freeze(end)),
    "slip": Kind("the FIFO loses a byte", strike=lambda chip, t, _: chip.slip(t)),
}


@dataclass(frozen=True)
class Fault:
    """A kind of fault, by its name in KINDS, at `at_s` of the bus's clock."""

    name: str
    at_s: float

    def __str__(self) -> str:
        return f"{self.name}@{self.at_s:g}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Of NAME@SECONDS; KeyError or ValueError of anything else."""
        name, _, seconds = text.partition("@")
        at_s = float(seconds)
        if name not in KINDS or not 0 <= at_s < math.inf:
            raise ValueError(text)
        return cls(name, at_s)

    @property
    def kind(self) -> Kind:
        """What its name stands for."""
        return KINDS[self.name]

    @property
    def begin_ns(self) -> int:
        """When it begins."""
        return round(self.at_s * 1e9)

    @property
    def end_ns(self) -> float:
        """When it is over."""
        return self.begin_ns + self.kind.seconds * 1e9


class Faults:
    """The faults of one bus, as its clock goes on.

    Parameters
    ----------
    faults : each at its time. chip, clock : what they happen to. rng : decides which bits flip.
    """

    def __init__(self, faults: tuple[Fault, ...], chip: Chip, clock: Clock, rng: np.random.Generator) -> None:
        self._faults, self._chip, self._clock, self._rng = faults, chip, clock, rng
        self._waiting = sorted(faults, key=lambda fault: fault.at_s)

    def before_transfer(self) -> None:
        """What happens now, before a transfer.

        Raises
        ------
        OSError : the transfer fails.
        """
        while self._waiting and self._waiting[0].begin_ns <= self._clock.now():
            fault = self._waiting.pop(0)
            self._clock.spend(round(fault.kind.pause_s * 1e9))
            if fault.kind.strike is not None:
                end_ns = max(fault.end_ns, self._clock.now()) if math.isfinite(fault.end_ns) else self._clock.now()
                fault.kind.strike(self._chip, self._clock.now(), round(end_ns))
        for kind in self._going_on():
            if kind.errno is not None:
                self._clock.spend(round(kind.takes_s * 1e9))
                raise OSError(kind.errno, os.strerror(kind.errno))

    def arriving(self, data: bytes) -> bytes:
        """What arrives of `data`, in either direction."""
        if not any(kind.flips for kind in self._going_on()):
            return data
        hit = self._rng.random(len(data)) < FLIPPED_BYTES
        flipped = np.frombuffer(data, np.uint8) ^ np.where(hit, 1 << self._rng.integers(0, 8, len(data)), 0)
        return flipped.astype(np.uint8).tobytes()

    def words(self) -> list[str]:
        """Each as in an option."""
        return [str(fault) for fault in self._faults]

    def _going_on(self) -> list[Kind]:
        now_ns = self._clock.now()
        return [fault.kind for fault in self._faults if fault.begin_ns <= now_ns < fault.end_ns]
