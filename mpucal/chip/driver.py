"""MPU driver over any bus: it identifies and configures the chip, drains its FIFO, and recovers from faults.

Its accesses depend on the replies and their times alone, so that a replay makes the same accesses.
DRIVER_VERSION counts up with every change of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from enum import Enum, auto

from ..clocks.sample_clock import poll_phase
from ..data import Recording, Samples, Sensor
from ..errors import BusError, BusHeld, ChipError, EndOfCapture
from . import registers as reg
from .access import Bus
from .config import MOST_FILLED, Config, Settings
from .decode import Decoder
from .fifo import FifoDecoder
from .identity import describe_mismatch
from .losses import Loss, TransferStats, remedy_of
from .offsets import PLACES
from .port import Port
from .setup import configure, is_configured, probe, read_identity, reset, restart_fifo, stop_fifo, wake

DRIVER_VERSION = 6

# The driver gives up after this time without a valid sample.
DEAD_NS = 2_000_000_000
# A longer poll counts as this long, since a host that slept says nothing about the chip. A poll on a bus that is held
# counts as this much longer: an adapter waits for its time-out, and no reply tells how long it was.
LONGEST_POLL_NS = 500_000_000

# Longer than the chip takes to write a frame, and no whole number of sample intervals.
FRAME_WRITTEN_NS = 300_000

# An overflow drops the oldest bytes, and the alignment is lost. A FIFO may have overflowed if no more frames are free.
SPARE_FRAMES = 3
# A larger share of repaired samples is reported; a hand's jerks are taken for flipped bits in four of 10,000 samples.
MAX_REPAIRED_SHARE = 0.001
# So many overflows show that a bus is too slow; fewer may come from a host that was late.
REPEATED_OVERFLOWS = 3

# INT_ENABLE, the DMP's status and INT_STATUS in one read: INT_ENABLE is 0 in a chip that was reset meanwhile.
STATUS_BYTES = reg.INT_STATUS - reg.INT_ENABLE + 1
# The status and a sample of a chip without a FIFO, in one read.
SAMPLE_BYTES = reg.ACCEL_XOUT_H + reg.FRAME_BYTES - reg.INT_ENABLE
# Reads whose times become those of samples, as (first register, number of bytes). They may be repeated after an error.
TIMED_READS = frozenset(((reg.FIFO_COUNT_H, 2), (reg.INT_ENABLE, SAMPLE_BYTES)))
NO_FIFO = "the chip's FIFO stays empty: its samples are read one by one, with the computer's times"


class Need(Enum):
    """Action that is needed before the next samples can be valid."""

    NOTHING = auto()
    RESTART = auto()
    SET_UP = auto()


class Driver:
    """Driver of one chip on one bus.

    Parameters
    ----------
    bus : the chip's bus. config : how to measure. name : name of the recording. stats : counts the transfers.
    say : called with remarks for the user on the chip at the start, and on its bus at the end: one sentence each,
        without a full stop.

    Attributes
    ----------
    settings : of the started chip. faults : number of polls whose samples were not accepted, by reason.
    """

    settings: Settings

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
        self._port = Port(bus, self._decoder.feed, stats)
        self._config = config or Config()
        self._polls = 0
        self._period_s = self._config.period_s
        self._next_poll_ns = 0
        self._need = Need.NOTHING
        self._fruitless_ns = 0
        self.faults: Counter[Loss] = Counter()
        self._frame_ns = math.inf

    def now_ns(self) -> int:
        """Return the time of the last access, in the provisional times of the samples."""
        fifo, now_ns = self._decoder.fifo, self._port.now_ns
        return now_ns if fifo is None else fifo.provisional_ns(now_ns)

    @property
    def repaired(self) -> int:
        """Number of samples in which a bit flipped on the bus was repaired."""
        return self._fifo.repaired

    def start(self) -> Sensor:
        """Identify, reset, wake and configure the chip, and start its FIFO.

        Raises
        ------
        BusError : a transfer failed three times. ChipError : an unknown chip, or it does not keep its settings.
        """
        read_identity(self._port)
        self._read_before_reset()
        reset(self._port)
        self._read_offsets()
        wake(self._port)
        probe(self._port)
        settings = self.settings = self._config.settings(self._decoder.part)
        configure(self._port, settings)
        if not settings.polled:
            filled_s = MOST_FILLED * settings.part.fifo_bytes / reg.FRAME_BYTES / self._config.rate_hz
            self._period_s = min(self._period_s, filled_s)
        self._restart()
        no_fifo = NO_FIFO if settings.polled else None
        for sentence in filter(None, (describe_mismatch(settings.sensor), self._correction_remark(), no_fifo)):
            self._say(sentence)
        return replace(settings.sensor, rate_hz=self._config.rate_hz) if settings.polled else settings.sensor

    def poll(self) -> Samples:
        """Wait for the next poll, and return the samples since the last one with provisional times; see `read`."""
        self.read()
        return self._fifo.take()

    def read(self) -> None:
        """Wait for the next poll, and read the samples since the last one.

        After an overflow, misaligned frames or a failed read of the FIFO, the FIFO is restarted, which leaves a gap.
        After a reset of the chip, or if the sensor repeats itself, the chip is set up again before that.

        Raises
        ------
        BusError, ChipError : the reason why no valid sample came for two seconds.
        BusError : the bus is too slow for the rate.
        """
        begun_ns, accepted = self._port.now_ns, self._fifo.accepted
        self._port.sleep_until(self._next_poll_ns)
        trouble: BusError | ChipError | None = None
        try:
            if self._need is Need.NOTHING:
                self._need = self._read_samples() if self.settings.polled else self._drain_fifo()
            if self._need is not Need.NOTHING:
                self._recover()
        except (BusError, ChipError) as error:
            trouble = error
            self._plan_next_poll()
        self._check_pace()
        fruitful = self._fifo.accepted > accepted
        self._fruitless_ns = 0 if fruitful else self._fruitless_ns + self._spent_ns(begun_ns, trouble)
        if self._fruitless_ns > DEAD_NS:
            raise trouble or self._diagnose_silence()

    def recording(self) -> Recording:
        """Return all samples with final times, and the measured rate and temperature."""
        return self._decoder.recording()

    def forget(self) -> None:
        """Forget all samples: `recording` holds those from now on."""
        self._fifo.forget()

    def stop(self) -> None:
        """Stop the FIFO if the bus still works; the chip stays awake."""
        with suppress(BusError, EndOfCapture):
            stop_fifo(self._port)
        fifo = self._decoder.fifo
        if fifo is not None and fifo.repaired > MAX_REPAIRED_SHARE * fifo.accepted:
            flipped = f"a bit had flipped on the bus in {fifo.repaired} samples, which were repaired"
            self._say(f"{flipped}: {Loss.FLIPPED.remedy}")
        if self._port.stats.errors:
            self._say(f"{self._port.stats}: {remedy_of(self._port.stats.errors)}")

    def _read_before_reset(self) -> None:
        # The reset reloads the factory's trim. These reads put earlier corrections into the capture.
        self._read_offsets()
        self._port.read(reg.XG_OFFSET_H, 6)
        self._port.read(reg.SMPLRT_DIV, 5)
        self._port.read(reg.PWR_MGMT_1, 2)

    def _read_offsets(self) -> None:
        # In the order of FAMILIES, which must stay: a capture replays only with the same accesses.
        for first, _, last in reversed(PLACES):
            self._port.read(first, last + 2 - first)

    def _correction_remark(self) -> str | None:
        """Return a sentence for the user if the offset registers held a correction, which the reset removed."""
        if self._decoder.corrected is None:
            return None
        before, trim = self._decoder.corrected
        return (
            f"the chip's offset registers held a correction, {before} in place of the factory trim {trim}; the reset"
            " removed it, and this calibration is for the chip without it"
        )

    def _drain_fifo(self) -> Need:
        """Read all whole frames in the FIFO, and feed them to the decoder; return what the chip needs next."""
        count, begun_ns = self._fifo_count(), self._port.now_ns
        self._plan_next_poll()
        settings = self.settings
        if count >= settings.part.fifo_bytes - SPARE_FRAMES * reg.FRAME_BYTES:
            self.faults[Loss.OVERFLOW] += 1
            return Need.RESTART
        frames = count // reg.FRAME_BYTES
        try:
            if frames:
                self._port.read_destructive(reg.FIFO_R_W, frames * reg.FRAME_BYTES)
            self._port.read_destructive(reg.INT_ENABLE, STATUS_BYTES)
        except BusError:
            # The read may have removed the bytes or the flag from the chip: a repeated one would begin within a frame.
            return Need.RESTART
        if frames:
            self._frame_ns = min(self._frame_ns, (self._port.now_ns - begun_ns) / frames)
        return self._after_poll()

    def _read_samples(self) -> Need:
        """Read samples one by one, without a FIFO, for a poll's period; return what the chip needs next."""
        step_ns = round(1e9 / self._config.rate_hz)
        for _ in range(max(1, round(self._period_s * self._config.rate_hz))):
            self._port.sleep_until(self._next_poll_ns)
            try:
                self._port.read(reg.INT_ENABLE, SAMPLE_BYTES)
            except BusError:
                return Need.RESTART
            self._next_poll_ns += step_ns
            if self._decoder.fault is not None:
                break
        return self._after_poll()

    def _after_poll(self) -> Need:
        """Count the last poll's fault, and return what the chip needs."""
        fault = self._decoder.fault
        if fault is None:
            return Need.NOTHING
        self.faults[fault] += 1
        return Need.SET_UP if fault is Loss.STUCK else Need.RESTART

    def _check_pace(self) -> None:
        """Raise BusError if the chip makes frames faster than the quickest read moved them, after several overflows."""
        rate_hz = self.settings.nominal_rate_hz
        if self.faults[Loss.OVERFLOW] < REPEATED_OVERFLOWS or not 1e9 <= self._frame_ns * rate_hz < math.inf:
            return
        raise BusError(
            f"the bus moves {1e9 / self._frame_ns:.0f} samples a second, but the chip takes {rate_hz:g}",
            "run the bus at 400 kHz (`dtparam=i2c_arm_baudrate=400000` on a Raspberry Pi), or use a lower --rate",
        )

    def _recover(self) -> None:
        """Restart the FIFO; before that, set up a chip that lost its settings or repeats itself."""
        if self._need is not Need.SET_UP and not is_configured(self._port, self.settings):
            self.faults[Loss.RESET] += 1
            self._need = Need.SET_UP
        if self._need is Need.SET_UP:
            self._set_up_again()
        self._restart()

    def _set_up_again(self) -> None:
        """Reset, wake and configure the chip, after a check that it is still the same one."""
        answer = self._port.read(reg.WHO_AM_I, 1)[0]
        part = self.settings.part
        if answer != part.who_am_i:
            raise ChipError(
                f"the {part.chip} answers 0x{answer:02x} to WHO_AM_I now, and answered 0x{part.who_am_i:02x} before",
                "check its wiring and supply, and that only one chip has its address",
            )
        reset(self._port)
        wake(self._port)
        configure(self._port, self.settings)

    def _restart(self) -> None:
        restart_fifo(self._port, self.settings)
        self._need = Need.NOTHING
        self._plan_next_poll()

    def _fifo_count(self) -> int:
        """Return the number of bytes in the FIFO, of whole frames if possible."""
        count = int.from_bytes(self._port.read(reg.FIFO_COUNT_H, 2), "big")
        if count % reg.FRAME_BYTES:
            # The chip is writing a frame, or the FIFO has slipped.
            self._port.sleep(FRAME_WRITTEN_NS)
            count = int.from_bytes(self._port.read(reg.FIFO_COUNT_H, 2), "big")
        return count

    def _plan_next_poll(self) -> None:
        """Set the time of the next poll, which varies by up to a sample interval, see poll_phase."""
        in_s = self._period_s + poll_phase(self._polls) * min(self._period_s, 1 / self._config.rate_hz)
        self._polls += 1
        self._next_poll_ns = self._port.now_ns + round(in_s * 1e9)

    def _spent_ns(self, begun_ns: int, trouble: BusError | ChipError | None) -> int:
        """Return the time that this poll took, limited to what the chip is to blame for."""
        held_ns = LONGEST_POLL_NS if isinstance(trouble, BusHeld) else 0
        return min(self._port.now_ns - begun_ns, LONGEST_POLL_NS) + held_ns

    def _diagnose_silence(self) -> ChipError:
        """Return the error that explains two seconds without a valid sample."""
        chip = self.settings.part.chip
        if not is_configured(self._port, self.settings):
            return ChipError(f"the {chip} lost its settings several times", Loss.RESET.remedy)
        if self.faults and self.faults.most_common(1)[0][0] is Loss.STUCK:
            return ChipError(f"the {chip} repeats one sample: not even the noise changes", Loss.STUCK.remedy)
        return ChipError(
            f"the {chip} gave no valid sample for {DEAD_NS * 1e-9:g} s",
            "switch its supply off and on, use a slower bus or a lower rate, and start again",
        )

    @property
    def _fifo(self) -> FifoDecoder:
        if self._decoder.fifo is None:
            raise RuntimeError("the driver was not started")
        return self._decoder.fifo
