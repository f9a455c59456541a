"""Register accesses to samples, as they happen or from a capture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from ..data import Recording, Samples, Sensor
from ..errors import RecordingError
from . import registers as reg
from .access import Transaction
from .families import Part
from .fifo import FifoDecoder, FifoFault, Run
from .identity import Behaviour
from .settings import Settings

Words = tuple[int, int, int]


class Decoder:
    """Follows every access that succeeded, and knows from those alone what the FIFO's bytes mean.

    The driver feeds it what it does and a capture what was done, so that both give the same samples.

    Attributes
    ----------
    fault : what the last poll's INT_STATUS said against what the poll read.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._held: dict[int, int] = {}
        self._evidence = Behaviour()
        self._settings: Settings | None = None
        self._fifo: FifoDecoder | None = None
        self._before_reset: dict[int, int] = {}
        self._accel_offsets: Words | None = None
        self.fault: FifoFault | None = None

    @property
    def corrected(self) -> tuple[Words, Words] | None:
        """Offset words before and after the reset where they differ: somebody had corrected the accelerometer."""
        before, after = (self._words(held) for held in (self._before_reset, self._held))
        return None if before is None or after is None or before == after else (before, after)

    @property
    def part(self) -> Part:
        """Which part the chip is, as it answered and behaved.

        Raises
        ------
        RecordingError : nobody asked for its identity. ChipError : no known part.
        """
        if reg.WHO_AM_I not in self._held:
            raise RecordingError(
                f"{self._name} does not say which chip it is (register 0x{reg.WHO_AM_I:02x})",
                "record again from the start of the chip",
            )
        return self._evidence.part(self._held[reg.WHO_AM_I])

    def saw(self, transaction: Transaction) -> None:
        """An access was made, or failed."""
        if transaction.error is not None:
            return
        if transaction.op == "read":
            self.saw_read(transaction.register, transaction.data, transaction.t_ns, transaction.host_ns)
        else:
            self.saw_write(transaction.register, transaction.data)

    def saw_read(self, register: int, data: bytes, t_ns: int, host_ns: int | None = None) -> None:
        """`data` was read from `register` on, at `t_ns`; `host_ns` as in Reply."""
        if self._fifo is None:
            self._hold(register, data)
            self._evidence.saw(register, data, self._held)
        elif register == reg.FIFO_COUNT_H:
            self._fifo.counted(t_ns, int.from_bytes(data, "big"))
            self._heard("look", t_ns, host_ns)
        elif register == reg.FIFO_R_W:
            self._fifo.data(data)
        elif register in (reg.INT_STATUS, reg.INT_ENABLE) and register + len(data) > reg.INT_STATUS:
            lost = register == reg.INT_ENABLE and not data[0] & reg.INT_FIFO_OFLOW
            self._heard("status", t_ns, host_ns)
            overflow = bool(data[reg.INT_STATUS - register] & reg.INT_FIFO_OFLOW)
            self.fault = self._fifo.judged(overflow, lost)
        elif register == reg.TEMP_OUT_H:
            self._fifo.temperature(int.from_bytes(data, "big", signed=True))
        else:
            self._hold(register, data)

    def saw_write(self, register: int, data: bytes) -> None:
        """`data` was written from `register` on.

        Raises
        ------
        RecordingError : the FIFO starts with settings that nobody told, or that changed.
        """
        if register == reg.PWR_MGMT_1 and data[0] & reg.PWR_MGMT_1_DEVICE_RESET:
            self._evidence.reset()
            self._before_reset = self._before_reset or dict(self._held)
            self._held = {reg.WHO_AM_I: self._held[reg.WHO_AM_I]} if reg.WHO_AM_I in self._held else {}
            return
        self._hold(register, data)
        if register == reg.USER_CTRL and data[0] & reg.USER_CTRL_FIFO_RESET:
            self._fifo_was_reset()

    def provisional_ns(self, t_ns: int) -> int:
        """`t_ns` of the bus's clock as the samples that `take` gives show it."""
        return t_ns if self._fifo is None else self._fifo.provisional_ns(t_ns)

    @property
    def flipped(self) -> int:
        """How many words of frames had a bit flipped on their way, and were set right."""
        return 0 if self._fifo is None else self._fifo.flipped

    @property
    def believed(self) -> int:
        """How many frames came since the start."""
        return 0 if self._fifo is None else self._fifo.believed

    def take(self) -> Samples:
        """The samples since the last `take`, with the times that are known now."""
        return self._fifo.take() if self._fifo is not None else Samples.empty()

    def release(self) -> list[Run]:
        """The frames since the last time, let go of: `final` makes samples of them once there are no more."""
        return self._fifo.release() if self._fifo is not None else []

    def final(self, runs: Iterable[Run]) -> Iterator[Samples]:
        """The samples of runs that were released, in the same order, with the best times there are."""
        return self._fifo.final(runs) if self._fifo is not None else iter(())

    @property
    def sensor(self) -> Sensor:
        """What is known of the sensor so far."""
        return replace(Sensor() if self._fifo is None else self._fifo.sensor, accel_offsets=self._accel_offsets)

    def forget(self) -> None:
        """Let go of all that was taken: `recording` holds what comes from now on."""
        if self._fifo is not None:
            self._fifo.forget()

    def recording(self) -> Recording:
        """All samples so far, with the best times there are."""
        if self._fifo is None:
            empty = Samples.empty()
            return Recording(**vars(empty), name=self._name)
        return replace(self._fifo.recording(self._name), sensor=self.sensor)

    def _hold(self, register: int, data: bytes) -> None:
        self._held.update(enumerate(data, register))

    def _heard(self, kind: str, t_ns: int, host_ns: int | None) -> None:
        if self._fifo is not None and host_ns is not None:
            self._fifo.heard(kind, t_ns, host_ns)

    def _fifo_was_reset(self) -> None:
        settings = Settings.from_registers(self._held, self.part, self._name)
        if self._fifo is None:
            self._settings, self._fifo = settings, FifoDecoder(settings)
            self._accel_offsets = self._words(self._held)
        elif settings != self._settings:
            raise RecordingError(f"{self._name} holds samples of two ranges or rates", "record each of them on its own")
        self._fifo.reset()

    def _words(self, held: Mapping[int, int]) -> Words | None:
        """What the accelerometer's offset registers held, if that is known."""
        place = self.part.family.accel_offset_h
        if not all(high + i in held for high in place for i in (0, 1)):
            return None
        x, y, z = (int.from_bytes([held[high], held[high + 1]], "big", signed=True) for high in place)
        return x, y, z


def decode(transactions: Iterable[Transaction], name: str = "recording") -> Recording:
    """The samples that `transactions` carried; what was cut off at their end does no harm.

    Raises
    ------
    RecordingError : the FIFO starts with settings that nobody told, or there are no two samples.
    ChipError : a chip that is not known.
    """
    decoder = Decoder(name)
    for transaction in transactions:
        decoder.saw(transaction)
    recording = decoder.recording()
    if len(recording) < 2:
        raise RecordingError(f"{name} holds {len(recording)} samples", "record for longer")
    return recording
