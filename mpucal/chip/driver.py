"""The MPU driver over any bus: identify, configure, drain the FIFO. Knows no clock of its own and no frame.

What it accesses depends on nothing but the replies and their times, so that a replay asks for the same
accesses. DRIVER_VERSION counts up with every change of them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from ..data import Recording, Samples, Sensor
from ..errors import BusError, ChipError
from . import registers as reg
from .access import Bus, EndOfCapture
from .clock import look_phase
from .config import Config
from .decode import Decoder
from .families import Family, Part, part_of
from .settings import Settings

DRIVER_VERSION = 1

MS = 1_000_000
# RM-MPU-6000A r4.2, registers 104 and 107; the start-up times of both product specifications are shorter.
RESET_NS = 100 * MS
WAKE_NS = 100 * MS
SETTLE_NS = 100 * MS
WAKE_TRIES = 5

TRIES = 3
RETRY_NS = MS
DEAD_S = 2.0

# Long after a frame is written, and no whole number of sample intervals.
FRAME_WRITTEN_NS = 300_000

# An overflow drops the oldest bytes, so a FIFO this full may have lost its frames' alignment.
SPARE_BYTES = 3 * reg.FRAME_BYTES

T = TypeVar("T")


class Driver:
    """One chip on one bus.

    Parameters
    ----------
    bus : where the chip is. config : how it is to measure. name : what to call its recording.
    """

    def __init__(self, bus: Bus, config: Config | None = None, name: str = "recording") -> None:
        self._bus = bus
        self._config = config or Config()
        self._decoder = Decoder(name)
        self._settings: Settings | None = None
        self._now_ns = 0
        self._polls = 0
        self._next_poll_ns = 0
        self._fruitless_polls = 0

    def now_ns(self) -> int:
        """The bus's clock as last seen."""
        return self._now_ns

    def start(self) -> Sensor:
        """Identify, reset, wake and configure the chip, and start its FIFO.

        Raises
        ------
        BusError : a transfer failed three times. ChipError : no known chip, or it does not keep its settings.
        """
        part = part_of(self._read(reg.WHO_AM_I, 1)[0])
        self._look_before_reset(part.family)
        self._reset()
        self._wake(part)
        self._settings = self._config.settings(part)
        self._configure(self._settings)
        self._restart_fifo()
        return self._settings.sensor

    def poll(self) -> Samples:
        """Wait for the next poll and give the samples since the last; their times are provisional.

        After an overflow, misaligned frames or a FIFO read that failed, the FIFO starts anew: a gap.

        Raises
        ------
        BusError : a transfer failed three times. ChipError : no samples for two seconds.
        """
        self._sleep_until(self._next_poll_ns)
        healthy = self._drain(self._running.part.family.fifo_bytes)
        samples = self._decoder.take()
        # counted in polls: a host that slept for a while says nothing about the chip
        self._fruitless_polls = 0 if len(samples) else self._fruitless_polls + 1
        if self._fruitless_polls * self._config.poll_s > DEAD_S:
            raise self._why_dead()
        if not healthy:
            self._restart_fifo()
        return samples

    def recording(self) -> Recording:
        """Everything so far, with the best times there are and the measured rate and temperature."""
        return self._decoder.recording()

    def stop(self) -> None:
        """Quiet the FIFO, if the bus still works; the chip stays awake."""
        with suppress(BusError, EndOfCapture):
            self._write(reg.FIFO_EN, 0)
            self._write(reg.USER_CTRL, 0)

    def _look_before_reset(self, family: Family) -> None:
        # the reset reloads the factory's trim: what somebody wrote there before is kept in the capture
        for high in family.accel_offset_h:
            self._read(high, 2)
        self._read(reg.XG_OFFSET_H, 6)
        self._read(reg.PWR_MGMT_1, 2)

    def _reset(self) -> None:
        self._write(reg.PWR_MGMT_1, reg.PWR_MGMT_1_DEVICE_RESET)
        self._sleep_until(self._now_ns + RESET_NS)
        self._write(reg.SIGNAL_PATH_RESET, reg.SIGNAL_PATH_RESET_ALL)
        self._sleep_until(self._now_ns + RESET_NS)

    def _wake(self, part: Part) -> None:
        for _ in range(WAKE_TRIES):
            self._write(reg.PWR_MGMT_1, reg.CLKSEL_PLL)
            self._sleep_until(self._now_ns + WAKE_NS)
            held = self._read(reg.PWR_MGMT_1, 1)[0]
            if held == reg.CLKSEL_PLL:
                return
        raise ChipError(
            f"the {part.chip} does not wake up (its PWR_MGMT_1 stays at 0x{held:02x})",
            "take its supply away for a moment, and check that it gets 3.3 V",
        )

    def _configure(self, settings: Settings) -> None:
        wanted = {reg.PWR_MGMT_2: 0, reg.INT_ENABLE: reg.INT_FIFO_OFLOW, **settings.registers()}
        for register, value in wanted.items():
            self._write(register, value)
        for register, value in wanted.items():
            held = self._read(register, 1)[0]
            if held != value:
                raise ChipError(
                    f"register 0x{register:02x} of the {settings.part.chip} reads 0x{held:02x} after"
                    f" 0x{value:02x} was written",
                    "check its wiring and supply, and that no other program uses it",
                )
        self._sleep_until(self._now_ns + SETTLE_NS)

    def _restart_fifo(self) -> None:
        """RM-MPU-6000A r4.2, register 106: the FIFO resets only while it is disabled."""
        self._write(reg.FIFO_EN, 0)
        self._write(reg.USER_CTRL, 0)
        self._write(reg.USER_CTRL, reg.USER_CTRL_FIFO_RESET)
        self._write(reg.USER_CTRL, reg.USER_CTRL_FIFO_EN)
        self._read(reg.INT_STATUS, 1)
        self._read(reg.TEMP_OUT_H, 2)
        self._write(reg.FIFO_EN, reg.FIFO_EN_FRAME)
        self._plan_next_poll()

    def _drain(self, fifo_bytes: int) -> bool:
        """Read all whole frames; False where they cannot be believed."""
        count = self._fifo_count()
        self._plan_next_poll()
        if count >= fifo_bytes - SPARE_BYTES:
            return False
        frames = count // reg.FRAME_BYTES
        if frames:
            try:
                self._read_once(reg.FIFO_R_W, frames * reg.FRAME_BYTES)
            except BusError:
                # the bytes that went by are gone: a second read would begin within a frame
                return False
        self._read(reg.INT_STATUS, 1)
        return self._decoder.fault is None

    def _fifo_count(self) -> int:
        count = int.from_bytes(self._read(reg.FIFO_COUNT_H, 2), "big")
        if count % reg.FRAME_BYTES:
            # the chip is writing a frame, or has slipped
            self._sleep_until(self._now_ns + FRAME_WRITTEN_NS)
            count = int.from_bytes(self._read(reg.FIFO_COUNT_H, 2), "big")
        return count

    def _plan_next_poll(self) -> None:
        period_s = self._config.poll_s
        in_s = period_s + look_phase(self._polls) * min(period_s, 1 / self._config.rate_hz)
        self._polls += 1
        self._next_poll_ns = self._now_ns + round(in_s * 1e9)

    def _why_dead(self) -> ChipError:
        """What two seconds without a sample come from."""
        chip = self._running.part.chip
        held = {register: self._read(register, 1)[0] for register in self._running.registers()}
        power = self._read(reg.PWR_MGMT_1, 1)[0]
        if power & reg.PWR_MGMT_1_SLEEP or held != self._running.registers():
            return ChipError(
                f"the {chip} has lost its settings (PWR_MGMT_1 is 0x{power:02x})",
                "its supply broke down: check the wires and connectors, then start again",
            )
        return ChipError(
            f"the {chip} gave no sample that can be believed for {DEAD_S:g} s",
            "take its supply away for a moment, slow the bus down or the rate, and start again",
        )

    @property
    def _running(self) -> Settings:
        if self._settings is None:
            raise RuntimeError("the driver polls before it was started")
        return self._settings

    def _read(self, register: int, count: int) -> bytes:
        return self._retried(lambda: self._read_once(register, count))

    def _read_once(self, register: int, count: int) -> bytes:
        reply = self._bus.read(register, count)
        self._now_ns = max(self._now_ns, reply.t_ns)
        self._decoder.saw_read(register, reply.data, reply.t_ns)
        return reply.data

    def _write(self, register: int, value: int) -> None:
        data = bytes([value])
        t_ns = self._retried(lambda: self._bus.write(register, data))
        self._now_ns = max(self._now_ns, t_ns)
        self._decoder.saw_write(register, data)

    def _retried(self, access: Callable[[], T]) -> T:
        for _ in range(TRIES - 1):
            try:
                return access()
            except BusError:
                self._sleep_until(self._now_ns + RETRY_NS)
        return access()

    def _sleep_until(self, t_ns: int) -> None:
        self._bus.sleep_until(t_ns)
        self._now_ns = max(self._now_ns, t_ns)
