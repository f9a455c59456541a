"""Decoder of register accesses to samples, as they happen or from a capture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..data import Recording, Samples, Sensor
from ..errors import RecordingError
from . import registers as reg
from .access import Transaction
from .accesses import Accesses
from .config import Settings
from .families import Part
from .fifo import FifoDecoder
from .identity import Behaviour
from .losses import Loss

Words = tuple[int, int, int]

# A poll is three accesses: count, bytes, flags. This many polls are checked together. Where one is not ordinary, those
# after it are checked again.
ACCESSES_A_POLL, POLLS_AT_ONCE = 3, 512


class Decoder:
    """Decoder of a chip's samples from all accesses to its registers, which show its identity and settings too.

    The driver feeds it its own accesses, and a reader those of a capture, so that both get the same samples.

    Attributes
    ----------
    fifo : decoder of the frames, from the first start of the FIFO on. fault : reason why the last poll was not
        accepted; None if it was.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._registers: dict[int, int] = {}
        self._behaviour = Behaviour()
        self.fifo: FifoDecoder | None = None
        self._before_reset: dict[int, int] = {}
        self._accel_offsets: Words | None = None
        self.fault: Loss | None = None

    @property
    def corrected(self) -> tuple[Words, Words] | None:
        """Offset words before and after the reset, if they differ: then the reset removed a correction."""
        before, after = (self._words(held) for held in (self._before_reset, self._registers))
        return None if before is None or after is None or before == after else (before, after)

    @property
    def part(self) -> Part:
        """Part that the chip is by its identity and behaviour.

        Raises
        ------
        RecordingError : WHO_AM_I was not read. ChipError : no known part.
        """
        if reg.WHO_AM_I not in self._registers:
            raise RecordingError(
                f"{self._name} does not say which chip it is (register 0x{reg.WHO_AM_I:02x})",
                "record again from the start of the chip",
            )
        return self._behaviour.part(self._registers[reg.WHO_AM_I])

    def feed(self, transaction: Transaction | Accesses) -> None:
        """Take one access, which may have failed, or many.

        Raises
        ------
        RecordingError : the FIFO starts with settings that are unknown, or that changed.
        """
        if isinstance(transaction, Accesses):
            self._feed_many(transaction)
            return
        # A damaged capture may hold an access of no bytes, which says nothing.
        if transaction.error is not None or not transaction.data:
            return
        if transaction.op == "read":
            self._feed_read(transaction.register, transaction.data, transaction.t_ns, transaction.host_ns)
        else:
            self._feed_write(transaction.register, transaction.data)

    def _feed_many(self, accesses: Accesses) -> None:
        """Decode runs of ordinary polls at once, and the other accesses one by one."""
        at = 0
        for first, last in poll_runs(accesses):
            self._feed_each(accesses, at, first)
            at = first
            while at < last:
                at += self._feed_polls(accesses, at, min(last, at + POLLS_AT_ONCE * ACCESSES_A_POLL))
                # The poll that was not ordinary.
                self._feed_each(accesses, at, min(last, at + ACCESSES_A_POLL))
                at = min(last, at + ACCESSES_A_POLL)
        self._feed_each(accesses, at, len(accesses))

    def _feed_read(self, register: int, data: bytes, t_ns: int, host_ns: int | None) -> None:
        if self.fifo is None:
            self._store(register, data)
            self._behaviour.observe(register, data, self._registers)
        elif register == reg.FIFO_COUNT_H:
            self.fifo.set_count(t_ns, int.from_bytes(data, "big"))
        elif register == reg.FIFO_R_W:
            self.fifo.add_bytes(data)
        elif register in (reg.INT_STATUS, reg.INT_ENABLE) and register + len(data) > reg.INT_STATUS:
            # The driver enabled this interrupt: a chip that shows it disabled was reset, and lost its settings.
            lost = register == reg.INT_ENABLE and not data[0] & reg.INT_FIFO_OFLOW
            if host_ns is not None:
                self.fifo.add_clock_pairs(np.array([t_ns]), np.array([host_ns]))
            polled = self.fifo.settings.polled
            if polled:
                self.fifo.set_count(t_ns, reg.FRAME_BYTES)
                self.fifo.add_bytes(data[reg.ACCEL_XOUT_H - register :])
            overflow = bool(data[reg.INT_STATUS - register] & reg.INT_FIFO_OFLOW)
            self.fault = self.fifo.finish_poll(overflow and not polled, lost)
        elif register == reg.TEMP_OUT_H:
            self.fifo.set_temperature(int.from_bytes(data, "big", signed=True))
        else:
            self._store(register, data)

    def _feed_write(self, register: int, data: bytes) -> None:
        if register == reg.PWR_MGMT_1 and data[0] & reg.PWR_MGMT_1_DEVICE_RESET:
            self._behaviour.reset()
            self._before_reset = self._before_reset or dict(self._registers)
            self._registers = {reg.WHO_AM_I: self._registers[reg.WHO_AM_I]} if reg.WHO_AM_I in self._registers else {}
            return
        self._store(register, data)
        if register == reg.USER_CTRL and data[0] & reg.USER_CTRL_FIFO_RESET:
            self._fifo_was_reset()

    @property
    def sensor(self) -> Sensor:
        """Sensor as far as it is known."""
        return replace(Sensor() if self.fifo is None else self.fifo.sensor, accel_offsets=self._accel_offsets)

    def recording(self) -> Recording:
        """Return all samples with final times."""
        if self.fifo is None:
            return Recording(**vars(Samples.empty()), name=self._name)
        return replace(self.fifo.recording(self._name), sensor=self.sensor)

    def _feed_each(self, accesses: Accesses, first: int, last: int) -> None:
        for transaction in accesses.part(first, last):
            self.feed(transaction)

    def _feed_polls(self, accesses: Accesses, first: int, last: int) -> int:
        """Decode the leading ordinary polls of the accesses first..last-1; return the number of their accesses."""
        if self.fifo is None or accesses.frames.shape[1] != reg.FRAME_WORDS:
            return 0
        counts, reads, checks = (np.arange(first + i, last, ACCESSES_A_POLL) for i in range(ACCESSES_A_POLL))
        frames = accesses.frames[accesses.begin[reads[0]] : accesses.end[reads[-1]]]
        lengths = accesses.end[reads] - accesses.begin[reads]
        polls = self.fifo.accept_plain_polls(accesses.t_ns[counts], frames, lengths)
        timed = checks[:polls][accesses.has_host_ns[checks[:polls]]]
        if len(timed):
            self.fifo.add_clock_pairs(accesses.t_ns[timed], accesses.host_ns[timed])
        if polls:
            self.fault = None
        return ACCESSES_A_POLL * polls

    def _store(self, register: int, data: bytes) -> None:
        self._registers.update(enumerate(data, register))

    def _fifo_was_reset(self) -> None:
        settings = Settings.from_registers(self._registers, self.part, self._name)
        if self.fifo is None:
            self.fifo = FifoDecoder(settings)
            self._accel_offsets = self._words(self._registers)
        elif settings != self.fifo.settings:
            raise RecordingError(f"{self._name} holds samples of two ranges or rates", "record each of them on its own")
        self.fifo.reset()

    def _words(self, held: Mapping[int, int]) -> Words | None:
        """Return the accelerometer's offset words; None if not all are in `held`."""
        place = self.part.family.accel_offset_h
        if not all(high + i in held for high in place for i in (0, 1)):
            return None
        x, y, z = (int.from_bytes([held[high], held[high + 1]], "big", signed=True) for high in place)
        return x, y, z


def poll_runs(accesses: Accesses) -> list[tuple[int, int]]:
    """Return (first, last + 1) of each run of ordinary polls: count, as many bytes, no overflow, settings kept."""
    n = len(accesses) - ACCESSES_A_POLL + 1
    if n < 1 or accesses.failures:
        return []
    count, read, check = (slice(i, n + i) for i in range(ACCESSES_A_POLL))
    register, moved = accesses.register, accesses.moved
    whole = (register[count] == reg.FIFO_COUNT_H) & (moved[count] == 2) & (register[read] == reg.FIFO_R_W)
    whole &= (register[check] == reg.INT_ENABLE) & (moved[check] == reg.INT_STATUS - reg.INT_ENABLE + 1)
    whole &= accesses.framed[read] & ~accesses.write[count] & ~accesses.write[check]
    at = np.flatnonzero(whole)
    counts, checks = accesses.begin[at], accesses.begin[at + 2]
    counted = accesses.data[counts].astype(np.int64) << 8 | accesses.data[counts + 1]
    # The check reads INT_ENABLE to INT_STATUS: the overflow interrupt is enabled still, and there was no overflow.
    sound = (accesses.data[checks] & ~accesses.data[checks + 2]) & reg.INT_FIFO_OFLOW
    at = at[(counted == moved[at + 1]) & (sound > 0)]
    cuts = np.flatnonzero(np.diff(at) != ACCESSES_A_POLL) + 1
    return [(int(part[0]), int(part[-1]) + ACCESSES_A_POLL) for part in np.split(at, cuts) if len(part)]


def decode(accesses: Iterable[Any], name: str = "recording", decoder_of: Callable[[str], Any] = Decoder) -> Recording:
    """Decode `accesses` to a recording; they may be cut off at the end.

    Parameters
    ----------
    decoder_of : class of the decoder: Decoder, or IioDecoder.

    Raises
    ------
    RecordingError : the FIFO starts with unknown settings, or there are fewer than two samples.
    ChipError : an unknown chip, or attributes that are not plausible.
    """
    decoder = decoder_of(name)
    for each in accesses:
        decoder.feed(each)
    recording: Recording = decoder.recording()
    if len(recording) < 2:
        raise RecordingError(f"{name} holds {len(recording)} samples", "record for longer")
    return recording
