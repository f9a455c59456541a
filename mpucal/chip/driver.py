"""The MPU driver over any bus: identify, configure, drain the FIFO, recover.

What it accesses depends on nothing but the replies and their times, so that a replay asks for the same
accesses. DRIVER_VERSION counts up with every change of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from enum import Enum, auto

from ..data import Recording, Samples, Sensor
from ..errors import BusError, BusHeld, ChipError, EndOfCapture
from . import registers as reg
from .access import Bus
from .clock import poll_phase
from .config import Config
from .decode import Decoder
from .families import Part
from .fifo import FifoFault
from .identity import describe_mismatch
from .offsets import PLACES
from .port import Port
from .probe import probe, read_identity
from .settings import Settings
from .setup import configure, is_configured, reset, restart_fifo, stop_fifo, wake
from .transfer_stats import REMEDY, TransferStats

DRIVER_VERSION = 6

# so long without a sample that can be accepted, and the driver gives up
DEAD_NS = 2_000_000_000
# a host that slept for a while says nothing about the chip
LONGEST_POLL_NS = 500_000_000
# what a transfer on a bus that is held takes of an adapter's time-out, which no reply tells
HELD_NS = 500_000_000

# Long after a frame is written, and no whole number of sample intervals.
FRAME_WRITTEN_NS = 300_000

# An overflow drops the oldest bytes, so a FIFO so many frames short of full may have lost its frames' alignment.
SPARE_FRAMES = 3
# of the samples; jerks of a hand are taken for flipped bits four times in ten thousand
MANY_FLIPPED = 0.001
# a host that was late once or twice says nothing about the bus
OVERFLOWS = 3

# INT_ENABLE, the DMP's status and INT_STATUS in one read: INT_ENABLE is 0 in a chip that was reset meanwhile
STATUS_BYTES = reg.INT_STATUS - reg.INT_ENABLE + 1
# the same and a sample, of a chip without a FIFO
SAMPLE_BYTES = reg.ACCEL_XOUT_H + reg.FRAME_BYTES - reg.INT_ENABLE
NO_FIFO = "the chip's FIFO stays empty, so that its samples are read one by one and their times are the computer's"


class Need(Enum):
    """What has to be done before the next samples can be accepted."""

    NOTHING = auto()
    RESTART = auto()
    SET_UP = auto()


_CURES = {
    None: Need.NOTHING,
    FifoFault.OVERFLOW: Need.RESTART,
    FifoFault.MISALIGNED: Need.RESTART,
    FifoFault.LATE: Need.RESTART,
    FifoFault.LOST: Need.RESTART,
}


class Driver:
    """One chip on one bus.

    Parameters
    ----------
    bus : where the chip is. config : how it is to measure. name : what to call its recording.
    say : is told what a person should know of this chip as it starts, and of its bus as it stops: one sentence, no full
        stop. stats : counts the transfers.

    Attributes
    ----------
    faults : how often what was read was not accepted, by kind.
    """

    def __init__(
        self,
        bus: Bus,
        config: Config | None = None,
        name: str = "recording",
        say: Callable[[str], None] = lambda _sentence: None,
        stats: TransferStats | None = None,
    ) -> None:
        self._say = say
        self._decoder = Decoder(name)
        self._port = Port(bus, self._decoder, stats)
        self._config = config or Config()
        self._settings: Settings | None = None
        self._polls = 0
        self._next_poll_ns = 0
        self._need = Need.NOTHING
        self._fruitless_ns = 0
        self.faults: Counter[FifoFault] = Counter()
        self._frame_ns = math.inf

    def now_ns(self) -> int:
        """The bus's clock as last seen, at the host's rate as far as that is known."""
        return self._decoder.provisional_ns(self._port.now_ns)

    @property
    def part(self) -> Part:
        """Which part it turned out to be; once it was started."""
        return self._running.part

    @property
    def flipped(self) -> int:
        """How many samples had a bit flipped on the bus, and were set right."""
        return self._decoder.flipped

    def start(self) -> Sensor:
        """Identify, reset, wake and configure the chip, and start its FIFO.

        Raises
        ------
        BusError : a transfer failed three times. ChipError : no known chip, or it does not keep its settings.
        """
        read_identity(self._port)
        self._look_before_reset()
        reset(self._port)
        self._look_at_offsets()
        wake(self._port)
        probe(self._port)
        self._settings = self._config.settings(self._decoder.part)
        configure(self._port, self._settings)
        self._restart()
        no_fifo = NO_FIFO if self._settings.polled else None
        for sentence in filter(None, (describe_mismatch(self._settings.sensor), self._correction(), no_fifo)):
            self._say(sentence)
        sensor = self._settings.sensor
        return replace(sensor, rate_hz=self._config.rate_hz) if self._settings.polled else sensor

    def poll(self) -> Samples:
        """Wait for the next poll and give the samples since the last; their times are provisional.

        After an overflow, misaligned frames or a FIFO read that failed, the FIFO starts anew: a gap. So it does
        after a reset of the chip or a sensor that repeats itself, once the chip was set up again.

        Raises
        ------
        BusError, ChipError : what prevented samples for two seconds. BusError : a bus too slow for the rate.
        """
        begun_ns = self._port.now_ns
        running = self._running
        self._port.sleep_until(self._next_poll_ns)
        trouble: BusError | ChipError | None = None
        try:
            if self._need is Need.NOTHING:
                self._need = self._look() if running.polled else self._drain(running)
            if self._need is not Need.NOTHING:
                self._recover(running)
        except (BusError, ChipError) as error:
            trouble = error
            self._plan_next_poll()
        self._check_pace(running)
        samples = self._decoder.take()
        self._fruitless_ns = 0 if len(samples) else self._fruitless_ns + self._spent_ns(begun_ns, trouble)
        if self._fruitless_ns > DEAD_NS:
            raise trouble or self._why_dead(running)
        return samples

    def recording(self) -> Recording:
        """Everything so far, with the best times there are and the measured rate and temperature."""
        return self._decoder.recording()

    def forget(self) -> None:
        """Let go of all samples so far: `recording` holds what comes from now on."""
        self._decoder.forget()

    def stop(self) -> None:
        """Quiet the FIFO, if the bus still works; the chip stays awake."""
        with suppress(BusError, EndOfCapture):
            stop_fifo(self._port)
        if self.flipped > MANY_FLIPPED * self._decoder.accepted:
            self._say(f"{self.flipped} samples had a bit flipped on the bus and were set right: {REMEDY}")
        if self._port.stats.errors:
            self._say(f"{self._port.stats}: {self._port.stats.remedy}")

    def _look_before_reset(self) -> None:
        # the reset reloads the factory's trim: what somebody wrote before is kept in the capture, wherever it is
        self._look_at_offsets()
        self._port.read(reg.XG_OFFSET_H, 6)
        self._port.read(reg.SMPLRT_DIV, 5)
        self._port.read(reg.PWR_MGMT_1, 2)

    def _look_at_offsets(self) -> None:
        # the oldest place first: captures replay only with the same accesses
        for first, _, last in reversed(PLACES):
            self._port.read(first, last + 2 - first)

    def _correction(self) -> str | None:
        if self._decoder.corrected is None:
            return None
        before, trim = self._decoder.corrected
        return (
            f"the chip's offset registers held a correction, {before} in place of the factory's {trim}; the reset has"
            " taken it away, and this calibration is of the chip without it"
        )

    def _drain(self, settings: Settings) -> Need:
        """Read all whole frames, and say what they need to be accepted."""
        count, begun_ns = self._fifo_count(settings.frame_bytes), self._port.now_ns
        self._plan_next_poll()
        if count >= settings.part.fifo_bytes - SPARE_FRAMES * settings.frame_bytes:
            self.faults[FifoFault.OVERFLOW] += 1
            return Need.RESTART
        frames = count // settings.frame_bytes
        try:
            if frames:
                self._port.read_destructive(reg.FIFO_R_W, frames * settings.frame_bytes)
            self._port.read_destructive(reg.INT_ENABLE, STATUS_BYTES)
        except BusError:
            # the bytes, or the flag, that went by are gone: a second read would begin within a frame
            return Need.RESTART
        if frames:
            self._frame_ns = min(self._frame_ns, (self._port.now_ns - begun_ns) / frames)
        return self._judged()

    def _look(self) -> Need:
        """Read samples one by one, for as long as there are polls of a FIFO apart."""
        step_ns = round(1e9 / self._config.rate_hz)
        for _ in range(max(1, round(self._config.period_s * self._config.rate_hz))):
            self._port.sleep_until(self._next_poll_ns)
            try:
                self._port.read(reg.INT_ENABLE, SAMPLE_BYTES)
            except BusError:
                return Need.RESTART
            self._next_poll_ns += step_ns
            if self._decoder.fault is not None:
                break
        return self._judged()

    def _judged(self) -> Need:
        """What the last poll needs, and counts why."""
        fault = self._decoder.fault
        if fault is not None:
            self.faults[fault] += 1
        return _CURES.get(fault, Need.SET_UP)

    def _check_pace(self, settings: Settings) -> None:
        """Raise BusError where frames come faster than even the quickest look took them, and not by chance."""
        rate_hz = settings.nominal_rate_hz
        if self.faults[FifoFault.OVERFLOW] < OVERFLOWS or self._frame_ns * rate_hz < 1e9 or self._frame_ns == math.inf:
            return
        raise BusError(
            f"the bus moves {1e9 / self._frame_ns:.0f} samples a second, where the chip takes {rate_hz:g}",
            "run it at 400 kHz (`dtparam=i2c_arm_baudrate=400000` on a Raspberry Pi), or take a lower --rate",
        )

    def _recover(self, settings: Settings) -> None:
        """Start the FIFO anew; before that, set up a chip that has lost its settings or repeats itself."""
        if self._need is not Need.SET_UP and not is_configured(self._port, settings):
            self.faults[FifoFault.LOST] += 1
            self._need = Need.SET_UP
        if self._need is Need.SET_UP:
            self._set_up_again(settings)
        self._restart()

    def _set_up_again(self, settings: Settings) -> None:
        answer = self._port.read(reg.WHO_AM_I, 1)[0]
        part = settings.part
        if answer != part.who_am_i:
            raise ChipError(
                f"the {part.chip} answers 0x{answer:02x} to WHO_AM_I now, and 0x{part.who_am_i:02x} before",
                "check its wiring and supply, and that only one chip has its address",
            )
        reset(self._port)
        wake(self._port)
        configure(self._port, settings)

    def _restart(self) -> None:
        restart_fifo(self._port, self._running)
        self._need = Need.NOTHING
        self._plan_next_poll()

    def _fifo_count(self, frame_bytes: int) -> int:
        count = int.from_bytes(self._port.read(reg.FIFO_COUNT_H, 2), "big")
        if count % frame_bytes:
            # the chip is writing a frame, or has slipped
            self._port.sleep(FRAME_WRITTEN_NS)
            count = int.from_bytes(self._port.read(reg.FIFO_COUNT_H, 2), "big")
        return count

    def _plan_next_poll(self) -> None:
        period_s = self._config.period_s
        in_s = period_s + poll_phase(self._polls) * min(period_s, 1 / self._config.rate_hz)
        self._polls += 1
        self._next_poll_ns = self._port.now_ns + round(in_s * 1e9)

    def _spent_ns(self, begun_ns: int, trouble: BusError | ChipError | None) -> int:
        """How long this poll took, as far as that says something about the chip."""
        held_ns = HELD_NS if isinstance(trouble, BusHeld) else 0
        return min(self._port.now_ns - begun_ns, LONGEST_POLL_NS) + held_ns

    def _why_dead(self, settings: Settings) -> ChipError:
        """What two seconds without a sample come from."""
        chip = settings.part.chip
        if not is_configured(self._port, settings):
            return ChipError(
                f"the {chip} loses its settings again and again",
                "its supply breaks down: check the wires and connectors, then start again",
            )
        if self.faults and self.faults.most_common(1)[0][0] is FifoFault.STUCK:
            return ChipError(
                f"the {chip} repeats itself: nothing that it measures changes, not even its noise",
                "take its supply away for a moment, check its solder joints and start again; if it does that again,"
                " replace the chip",
            )
        return ChipError(
            f"the {chip} gave no sample that can be accepted for {DEAD_NS * 1e-9:g} s",
            "take its supply away for a moment, slow the bus down or the rate, and start again",
        )

    @property
    def _running(self) -> Settings:
        if self._settings is None:
            raise RuntimeError("the driver polls before it was started")
        return self._settings
