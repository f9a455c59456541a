"""Accelerometer offset registers: their possible addresses, their content, and the measured effect of a count.

Source: RM-MPU-6000A (0x06, two bytes an axis, one after the other); RM-MPU-9250A r1.4, registers 119 to 126 (0x77,
with a reserved byte after each axis). 15 bits in [15:1]; bit 0 is reserved and kept. They hold the factory trim after
power-on, and lose what was written with the supply. Clones move them, and even InvenSense's own drivers disagree on the
scale: so a known step is written, half a second is averaged, and the step is removed again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Self

import numpy as np

from ..data import Vector
from ..errors import BoardMoved, BusError, ChipError, UnknownOffsets
from .families import FAMILIES
from .port import Port
from .quick_measure import TemporaryMeasurement

Place = tuple[int, int, int]
Words = tuple[int, int, int]

# The last family of the table first.
PLACES: tuple[Place, ...] = tuple(dict.fromkeys(family.accel_offset_h for family in reversed(FAMILIES)))

RESERVED_BIT = 1
WORD = np.iinfo(np.int16)

# A wire that was touched makes contact again within seconds.
RESTORE_WAITS_NS = tuple(1_000_000 * 4**i for i in range(7))


class OffsetRegisters(NamedTuple):
    """Bytes from the first offset register to the last, so that one transfer writes the three axes.

    Attributes
    ----------
    place : addresses of the high bytes x, y, z. data : content, including reserved bytes in between.
    """

    place: Place
    data: bytes

    @classmethod
    def read(cls, port: Port, place: Place) -> Self:
        """Read the chip's registers; raise BusError if they cannot be read."""
        return cls(place, port.read(place[0], place[2] + 2 - place[0]))

    @property
    def words(self) -> Words:
        """Signed 16-bit words of the three axes, reserved bit included."""
        x, y, z = (int.from_bytes(self.data[high - self.place[0] :][:2], "big", signed=True) for high in self.place)
        return x, y, z

    def with_words(self, words: Sequence[int]) -> OffsetRegisters:
        """Return a copy with other words; the bytes in between are kept."""
        data = bytearray(self.data)
        for high, word in zip(self.place, words, strict=True):
            data[high - self.place[0] : high - self.place[0] + 2] = word.to_bytes(2, "big", signed=True)
        return OffsetRegisters(self.place, bytes(data))

    def write(self, port: Port) -> bool:
        """Write the registers in one transfer; return True if the chip then holds them.

        Raises
        ------
        BusError : a transfer failed.
        """
        port.write_block(self.place[0], self.data)
        return port.read(self.place[0], len(self.data)) == self.data


def shift_words(words: Words, counts: Iterable[float]) -> Words:
    """Add `counts` to `words`, rounded to the resolution of [15:1]; bit 0 is kept.

    Raises
    ------
    ChipError : the sum does not fit into a register.
    """
    x, y, z = (
        (old & ~RESERVED_BIT) + 2 * round(count / 2) | (old & RESERVED_BIT)
        for old, count in zip(words, counts, strict=True)
    )
    if not all(WORD.min <= word <= WORD.max for word in (x, y, z)):
        raise ChipError(
            f"the offset registers cannot hold {x}, {y}, {z}",
            "use the calibration's files: so large a bias does not fit into the registers with the factory trim",
        )
    return x, y, z


def word_difference(new: Words, old: Words) -> tuple[int, int, int]:
    """Return by how many counts `new` acts more than `old`: bit 0 has no effect."""
    x, y, z = ((a & ~RESERVED_BIT) - (b & ~RESERVED_BIT) for a, b in zip(new, old, strict=True))
    return x, y, z


@contextmanager
def restoring(port: Port, old: OffsetRegisters) -> Iterator[None]:
    """Restore `old` at the end of a `with` block that writes other words, however the block ends.

    Raises
    ------
    ChipError : `old` cannot be restored.
    """
    try:
        yield
    finally:
        restore(port, old)


def restore(port: Port, old: OffsetRegisters) -> None:
    """Write `old` if the chip does not hold it, with retries for as long as a bad contact may last.

    Raises
    ------
    ChipError : the chip does not take it.
    """
    for wait_ns in RESTORE_WAITS_NS:
        try:
            if OffsetRegisters.read(port, old.place) == old or old.write(port):
                return
        except BusError:
            pass
        port.sleep(wait_ns)
    raise ChipError(
        f"the accelerometer's offset registers could not be restored to {old.data.hex(' ')} at 0x{old.place[0]:02x}",
        "switch the chip's supply off and on, which brings back its factory trim",
    )


# A different step on each axis shows axes that are swapped.
STEPS = (256, 320, 384)
# Words beyond this take the step in the other direction, so that it fits.
LARGEST_TO_STEP_UP = WORD.max - max(STEPS)

SCALES_LSB_PER_G = (2048.0, 4096.0)
# Share of a step by which a measured one may differ: the accelerometer's own scale is within 3 %.
TOLERANCE = 0.1
# The largest difference between two readings of a board at rest [g].
MOTION_G = 0.006


class OffsetResponse(NamedTuple):
    """Effect of the offset registers.

    Attributes
    ----------
    place : their addresses. lsb_per_g : counts that make 1 g. g_per_lsb : (3,) as measured, axis by axis.
    """

    place: Place
    lsb_per_g: float
    g_per_lsb: Vector


def measure_offset_response(port: Port, measurement: TemporaryMeasurement, likely: Place = PLACES[0]) -> OffsetResponse:
    """Try the `likely` place, then the others; the registers hold their old content afterwards.

    Raises
    ------
    BusError : a transfer failed. UnknownOffsets : no place responds, or one responds with an unknown scale.
    ChipError : the board moves, or the old words could not be restored.
    """
    for place in sorted(PLACES, key=lambda place: place != likely):
        old = OffsetRegisters.read(port, place)
        steps = [step if word <= LARGEST_TO_STEP_UP else -step for step, word in zip(STEPS, old.words, strict=True)]
        probe = old.with_words(shift_words(old.words, steps))
        before = measurement.rest()
        with restoring(port, old):
            kept = probe.write(port)
            during = measurement.rest() if kept else before
        if not kept:
            continue
        after = measurement.rest()
        if (np.abs(after - before) > MOTION_G).any():
            raise BoardMoved(
                "the board moved while its offset registers were tried", "put it on a firm surface and let go of it"
            )
        shift = during - (before + after) / 2
        if (np.abs(shift) > min(STEPS) / max(SCALES_LSB_PER_G) / 2).any():
            return _identify_scale(place, shift, np.array(word_difference(probe.words, old.words)))
    raise UnknownOffsets(
        "the accelerometer does not respond to its offset registers, neither at "
        + " nor at ".join(f"0x{place[0]:02x}" for place in PLACES),
        "use the calibration's files: this chip cannot hold a correction",
    )


def is_as_written(shift_g: Vector, written_g: Vector) -> bool:
    """Return True if readings at rest changed by (3,) g as the registers did, but for motion and the sensor's scale."""
    return bool((np.abs(shift_g - written_g) <= MOTION_G + TOLERANCE * np.abs(written_g)).all())


def _identify_scale(place: Place, shift_g: Vector, counts: Vector) -> OffsetResponse:
    for scale in SCALES_LSB_PER_G:
        if is_as_written(shift_g, counts / scale):
            return OffsetResponse(place, scale, shift_g / counts)
    per_256 = ", ".join(f"{256_000 * value:+.0f}" for value in shift_g / counts)
    raise UnknownOffsets(
        f"256 counts in the offset registers at 0x{place[0]:02x} have an effect of {per_256} mg; known chips have 125"
        " or 62.5",
        "use the calibration's files: a correction in these registers would be wrong",
    )
