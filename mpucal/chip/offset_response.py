"""Where a chip's offset registers really are and what a count of them does, by measuring.

Clones move them, and even InvenSense's own drivers disagree on the scale: so a known step is written, half a second
is averaged, and the step is taken away again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..errors import ChipError, OddOffsets
from .offsets import PLACES, OffsetRegisters, Place, restoring, shift_words, word_difference
from .port import Port
from .quick_measure import TemporaryMeasurement

# of different size on each axis, so that axes that are swapped show
STEPS = (256, 320, 384)
# a step goes towards zero where it would not fit
ROOM = 30_000

SCALES_LSB_PER_G = (2048.0, 4096.0)
# the accelerometer's own scale is within 3 %
TOLERANCE = 0.15
# half of the smallest step, in g; and what a board that lay still may differ by
NOTHING_G, MOVED_G = 0.03, 0.006


@dataclass(frozen=True)
class OffsetResponse:
    """What the offset registers do.

    Attributes
    ----------
    place : where they are. lsb_per_g : counts that make 1 g. g_per_lsb : (3,) as measured, axis by axis.
    """

    place: Place
    lsb_per_g: float
    g_per_lsb: Vector


def measure_offset_response(port: Port, measurement: TemporaryMeasurement, likely: Place = PLACES[0]) -> OffsetResponse:
    """Try the `likely` place, then the others; the registers hold afterwards what they held before.

    Raises
    ------
    BusError : a transfer failed. OddOffsets : no place answers, or one answers as no register map says.
    ChipError : the board moves, or the old words could not be restored.
    """
    for place in sorted(PLACES, key=lambda place: place != likely):
        old = OffsetRegisters.read(port, place)
        steps = [step if word < ROOM else -step for step, word in zip(STEPS, old.words, strict=True)]
        probe = old.with_words(shift_words(old.words, steps))
        before = measurement.rest()
        with restoring(port, old):
            kept = probe.write(port)
            during = measurement.rest() if kept else before
        if not kept:
            continue
        after = measurement.rest()
        if (np.abs(after - before) > MOVED_G).any():
            raise ChipError(
                "the board moved while its offset registers were tried", "put it on a firm surface and let go of it"
            )
        shift = during - (before + after) / 2
        if (np.abs(shift) > NOTHING_G).any():
            return _understood(place, shift / np.array(word_difference(probe.words, old.words)))
    raise OddOffsets(
        "the accelerometer does not answer to its offset registers, neither at "
        + " nor at ".join(f"0x{place[0]:02x}" for place in PLACES),
        "use the calibration's files: this chip cannot hold a correction",
    )


def _understood(place: Place, g_per_lsb: Vector) -> OffsetResponse:
    for scale in SCALES_LSB_PER_G:
        if (np.abs(g_per_lsb * scale - 1) < TOLERANCE).all():
            return OffsetResponse(place, scale, g_per_lsb)
    per_256 = ", ".join(f"{256_000 * value:+.0f}" for value in g_per_lsb)
    raise OddOffsets(
        f"the offset registers at 0x{place[0]:02x} answer to 256 counts with {per_256} mg, where 125 or 62.5 are known",
        "use the calibration's files: a correction would land in the wrong place",
    )
