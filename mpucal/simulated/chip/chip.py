"""Simulated chip: registers, a sample clock of its own and a FIFO.

Source: RM-MPU-6000A r4.2, RM-MPU-9250A r1.4.
"""

from __future__ import annotations

import numpy as np

from ...chip import registers as reg
from ...chip.families import Family
from ...data import Vector
from ...errors import EndOfCapture
from ..sensor import Counts, Feed, Setting
from .models import FactoryTrim, Model, Three


class Fifo:
    """Queue that overflows as the chip's does: by bytes, not by frames.

    Parameters
    ----------
    size : in bytes.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._bytes = bytearray()
        self._last = 0

    def __len__(self) -> int:
        return len(self._bytes)

    def push(self, data: bytes, stop_when_full: bool) -> bool:
        """Append `data`; return True if it did not fit, so that the oldest (or the newest) bytes are lost."""
        self._bytes += data
        excess = len(self._bytes) - self.size
        if excess <= 0:
            return False
        if stop_when_full:
            del self._bytes[-excess:]
        else:
            del self._bytes[:excess]
        return True

    def pop(self, count: int) -> bytes:
        """Return the `count` oldest bytes; an empty FIFO repeats the last byte."""
        data = bytes(self._bytes[:count])
        del self._bytes[:count]
        if data:
            self._last = data[-1]
        return data + bytes([self._last]) * (count - len(data))

    def clear(self) -> None:
        """Drop all bytes."""
        self._bytes.clear()


# A write that changes one of these restarts the sample clock,
SAMPLING = frozenset((reg.SMPLRT_DIV, reg.CONFIG, reg.PWR_MGMT_1))
# and a write to one of these if it changes the rate.
PACING = frozenset((reg.PWR_MGMT_2, reg.ACCEL_CONFIG2))
AFTER_SAMPLE = reg.ACCEL_XOUT_H + reg.FRAME_BYTES


class Chip:
    """Chip as its bus sees it; `t_ns` never decreases.

    Parameters
    ----------
    model, feed : kind of chip, and source of its samples.
    rate_error_ppm : of the sample clock, positive if it is fast.
    factory : settings of this piece.
    """

    def __init__(self, model: Model, feed: Feed, rate_error_ppm: float, factory: FactoryTrim | None = None) -> None:
        self._model, self._feed, self._factory = model, feed, factory or FactoryTrim()
        self._speed = 1 + rate_error_ppm * 1e-6
        self._writable = model.writable()
        self._fifo = Fifo(model.family.fifo_bytes)
        self._ended = False
        self._setting: Setting | None = None
        self._unread: Vector | None = None
        self._frozen_until_ns = 0
        self._frozen: Counts | None = None
        self._cleared: list[tuple[int, int]] = []
        self._held: list[tuple[int | slice, int]] = []
        self.reset(0)

    def read(self, register: int, count: int, t_ns: int) -> bytes:
        """Return `count` bytes from `register` on; FIFO_R_W does not auto-increment.

        Raises
        ------
        EndOfCapture : the feed has ended and the FIFO is drained.
        """
        self._advance(t_ns)
        data, address = bytearray(), register
        while len(data) < count and address != reg.FIFO_R_W:
            if reg.ACCEL_XOUT_H <= address < AFTER_SAMPLE:
                more = self._latest_sample()[address - reg.ACCEL_XOUT_H :][: count - len(data)]
            else:
                more = bytes([self._read_byte(address)])
            data += more
            address = (address + len(more)) & 0x7F
        return bytes(data) + self._pop_fifo(count - len(data))

    def write(self, register: int, data: bytes, t_ns: int) -> None:
        """Write from `register` on; bytes for read-only registers are ignored."""
        self._advance(t_ns)
        self._collect()
        for i, value in enumerate(data):
            if register + i in self._writable:
                self._write_byte(register + i, value, t_ns)

    def reset(self, t_ns: int) -> None:
        """Set all registers as after power-on, and empty the FIFO."""
        self._registers = self._model.reset_values(self._factory)
        self._fifo.size = self._model.family.fifo_bytes
        self._fifo.clear()
        self._latest, self._unread = bytes(reg.FRAME_BYTES), None
        self._setting = None
        self._start_clock(t_ns)

    def _read_byte(self, address: int) -> int:
        if address == reg.INT_STATUS:
            status, self._registers[reg.INT_STATUS] = self._registers[reg.INT_STATUS], 0
            return status
        if address == reg.FIFO_COUNT_H:
            self._latch_fifo_count()
        return self._registers[address]

    def _write_byte(self, address: int, value: int, t_ns: int) -> None:
        if address == reg.PWR_MGMT_1 and value & reg.PWR_MGMT_1_DEVICE_RESET:
            self.reset(t_ns)
            return
        if address == reg.USER_CTRL:
            value = self._user_control(value)
        elif address == reg.SIGNAL_PATH_RESET:
            value = 0
        elif address == reg.FIFO_EN:
            value &= self._model.family.fifo_en_frame
        changed = self._registers[address] != value
        self._registers[address] = value
        self._setting = None
        if address == reg.ACCEL_CONFIG2:
            self._resize_fifo(self._model.fifo_bytes(value))
        if (address in SAMPLING and changed) or (address in PACING and self._rate() != self._rate_hz):
            self._start_clock(t_ns)

    def _user_control(self, value: int) -> int:
        """Execute the self-clearing bits, and return the others."""
        running = value & reg.USER_CTRL_FIFO_EN and self._model.family.fifo_reset_needs_stop
        if value & reg.USER_CTRL_FIFO_RESET and not running:
            self._fifo.clear()
        if value & reg.USER_CTRL_SIG_COND_RESET:
            self._latest, self._unread = bytes(reg.FRAME_BYTES), None
        return value & ~(reg.USER_CTRL_FIFO_RESET | reg.USER_CTRL_SIG_COND_RESET)

    def _resize_fifo(self, size: int) -> None:
        """Set the size; a FIFO that is running loses its content: no register map says what happens."""
        if size != self._fifo.size and self._registers[reg.USER_CTRL] & reg.USER_CTRL_FIFO_EN:
            self._fifo.clear()
        self._fifo.size = size

    def _pop_fifo(self, count: int) -> bytes:
        if len(self._fifo) < count:
            self._collect()
        return self._fifo.pop(count)

    def _latch_fifo_count(self) -> None:
        self._collect()
        if self._ended and not len(self._fifo):
            raise EndOfCapture
        self._registers[reg.FIFO_COUNT_H : reg.FIFO_R_W] = len(self._fifo).to_bytes(2, "big")

    # Faults.

    def change_speed(self, factor: float, t_ns: int) -> None:
        """Run the sample clock `factor` times as fast from now on."""
        self._advance(t_ns)
        self._collect()
        self._speed *= factor
        self._start_clock(t_ns)

    def freeze(self, until_ns: int) -> None:
        """Repeat the same sample until then."""
        self._collect()
        self._frozen_until_ns, self._frozen = until_ns, None

    def clear_bits(self, word: int, bits: int) -> None:
        """Clear these bits of word number `word` of each sample from now on."""
        self._collect()
        self._cleared.append((word, bits))

    def hold_words(self, words: int | slice, count: int) -> None:
        """Keep these words of each sample at `count`."""
        self._held.append((words, count))

    def lose_fifo_byte(self, t_ns: int) -> None:
        """Drop a byte of the FIFO."""
        self._advance(t_ns)
        self._collect()
        self._fifo.pop(1)

    # The sample clock.

    def _start_clock(self, t_ns: int) -> None:
        self._start_ns, self._taken, self._collected = t_ns, 0, 0
        self._rate_hz = self._rate()

    def _rate(self) -> float:
        """Return the nominal sample rate [Hz]."""
        divider, dlpf = self._registers[reg.SMPLRT_DIV], self._registers[reg.CONFIG] & reg.CONFIG_DLPF_CFG
        if not self._model.family.has_accel_config2:
            return reg.sample_rate_hz(divider, dlpf)
        # RM-MPU-9250A, register 25: the divider has no effect on the filter's 8 kHz.
        base_hz = reg.base_rate_hz(dlpf)
        return base_hz if base_hz > reg.MAX_RATE_HZ else reg.sample_rate_hz(divider, dlpf)

    def _advance(self, t_ns: int) -> None:
        """Take the samples that are due; measure them if the FIFO gets full."""
        if self._registers[reg.PWR_MGMT_1] & reg.PWR_MGMT_1_SLEEP:
            return
        due = int((t_ns - self._start_ns) * 1e-9 / self._period_s)
        if due <= self._taken:
            return
        self._taken = due
        self._registers[reg.INT_STATUS] |= reg.INT_DATA_RDY
        if not (self._registers[reg.USER_CTRL] & reg.USER_CTRL_FIFO_EN and self._registers[reg.FIFO_EN]):
            # With the FIFO off, only the last sample can be read, so only that one is measured.
            self._unread, self._collected = self._edges_s(due - 1), due
        elif len(self._fifo) + (due - self._collected) * reg.FRAME_BYTES > self._fifo.size:
            self._collect()

    @property
    def _period_s(self) -> float:
        return 1.0 / (self._rate_hz * self._speed)

    def _edges_s(self, first: int) -> Vector:
        """Return the times at which the samples from number `first` on began, and the last one ended."""
        number = np.arange(first, self._taken + 1, dtype=np.float64)
        return np.asarray(self._start_ns * 1e-9 + self._period_s * number)

    def _collect(self) -> None:
        """Measure the samples taken for the FIFO: as late as possible, since many samples at once cost least."""
        if self._collected == self._taken:
            return
        counts = self._measure(self._edges_s(self._collected))
        self._unread, self._collected = None, self._taken
        if not len(counts):
            return
        words = counts.astype(">i2")
        self._latest = words[-1].tobytes()
        stop = bool(self._registers[reg.CONFIG] & reg.CONFIG_FIFO_MODE_STOP)
        columns = _columns(self._registers[reg.FIFO_EN], self._model.family)
        if self._fifo.push(words[:, columns].tobytes(), stop):
            self._registers[reg.INT_STATUS] |= reg.INT_FIFO_OFLOW

    def _latest_sample(self) -> bytes:
        self._collect()
        if self._unread is not None:
            counts = self._measure(self._unread)
            self._unread = None
            if not len(counts):
                raise EndOfCapture
            self._latest = counts[-1].astype(">i2").tobytes()
        return self._latest

    def _measure(self, edges_s: Vector) -> Counts:
        counts = self._feed.samples(edges_s, self._current_setting())
        for word, bits in self._cleared:
            counts[:, word] &= ~bits
        for words, count in self._held:
            counts[:, words] = count
        self._ended = len(counts) < len(edges_s) - 1
        if len(counts) and edges_s[0] * 1e9 < self._frozen_until_ns:
            self._frozen = counts[:1] if self._frozen is None else self._frozen
            return np.repeat(self._frozen, len(counts), axis=0)
        return counts

    def _current_setting(self) -> Setting:
        if self._setting is None:
            self._setting = _setting(self._registers, self._rate_hz, self._model, self._factory)
        return self._setting


# Bits of FIFO_EN for a sample's seven words, in register order
WORD_BITS = (*[reg.FIFO_EN_ACCEL] * 3, reg.FIFO_EN_TEMP, reg.FIFO_EN_XG, reg.FIFO_EN_YG, reg.FIFO_EN_ZG)


def _columns(sources: int, family: Family) -> list[int]:
    """Return the numbers of a sample's words that FIFO_EN selects."""
    if family.has_i2c_if:
        sources |= reg.FIFO_EN_TEMP
        sources |= reg.FIFO_EN_XG | reg.FIFO_EN_YG if sources & reg.FIFO_EN_ZG else 0
    return [word for word, bit in enumerate(WORD_BITS) if sources & bit]


def _setting(registers: bytearray, rate_hz: float, model: Model, factory: FactoryTrim) -> Setting:
    """Return the settings in the registers."""
    accel, gyro = registers[reg.ACCEL_CONFIG], registers[reg.GYRO_CONFIG]
    ax, ay, az = (
        ((_word(registers, address) & ~1) - (trim & ~1)) / model.offset_scale + response
        for address, trim, response in zip(
            model.family.accel_offset_h, factory.accel_trim, _self_test(accel, factory.accel_self_test_g), strict=True
        )
    )
    gx, gy, gz = (
        _word(registers, reg.XG_OFFSET_H + 2 * axis) / reg.GYRO_OFFSET_LSB_PER_DPS + response
        for axis, response in enumerate(_self_test(gyro, factory.gyro_self_test_dps))
    )
    afs_sel = accel >> reg.FULL_SCALE_SHIFT & reg.FULL_SCALE_CODES
    fs_sel = gyro >> model.family.gyro_range_shift & reg.FULL_SCALE_CODES
    return Setting(
        rate_hz=rate_hz,
        accel_range_g=reg.ACCEL_RANGES_G[afs_sel] / model.accel_sensitivity,
        gyro_range_dps=reg.GYRO_RANGES_DPS[fs_sel],
        lsb_per_c=model.family.lsb_per_c,
        zero_c=model.family.zero_c,
        accel_offset_g=(ax, ay, az),
        gyro_offset_dps=(gx, gy, gz),
        accel_lag_s=model.family.accel_lag_s(registers[reg.CONFIG] & reg.CONFIG_DLPF_CFG),
    )


def _self_test(config: int, responses: Three) -> Three:
    """Return the self-test responses of x, y, z that bits 7, 6 and 5 switch on."""
    x, y, z = (response if config & 0x80 >> axis else 0.0 for axis, response in enumerate(responses))
    return x, y, z


def _word(registers: bytearray, address: int) -> int:
    return int.from_bytes(registers[address : address + 2], "big", signed=True)
