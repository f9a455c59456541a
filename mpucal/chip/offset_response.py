"""Measurement of where a chip's offset registers are, and what a count of them does.

Clones move them, and even InvenSense's own drivers disagree on the scale. So a known step is written, half a second is
averaged, and the step is removed again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..errors import BoardMoved, OddOffsets
from .offsets import PLACES, OffsetRegisters, Place, restoring, shift_words, word_difference
from .port import Port
from .quick_measure import TemporaryMeasurement

# A different step on each axis shows axes that are swapped.
STEPS = (256, 320, 384)
# Words beyond this take the step in the other direction, so that it fits.
LARGEST_TO_STEP_UP = 30_000

SCALES_LSB_PER_G = (2048.0, 4096.0)
# The accelerometer's own scale is within 3 %.
TOLERANCE = 0.15
# Half of the smallest step [g], and the largest difference between two readings of a board at rest [g].
LEAST_SHIFT_G, MOTION_G = 0.03, 0.006


@dataclass(frozen=True)
class OffsetResponse:
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
    BusError : a transfer failed. OddOffsets : no place responds, or one responds with an unknown scale.
    ChipError : the board moves, or the old words could not be restored.
    """
    for place in sorted(PLACES, key=lambda place: place != likely):
        old = OffsetRegisters.read(port, place)
        steps = [step if word < LARGEST_TO_STEP_UP else -step for step, word in zip(STEPS, old.words, strict=True)]
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
        if (np.abs(shift) > LEAST_SHIFT_G).any():
            return _identify_scale(place, shift / np.array(word_difference(probe.words, old.words)))
    raise OddOffsets(
        "the accelerometer does not respond to its offset registers, neither at "
        + " nor at ".join(f"0x{place[0]:02x}" for place in PLACES),
        "use the calibration's files: this chip cannot hold a correction",
    )


def _identify_scale(place: Place, g_per_lsb: Vector) -> OffsetResponse:
    for scale in SCALES_LSB_PER_G:
        if (np.abs(g_per_lsb * scale - 1) < TOLERANCE).all():
            return OffsetResponse(place, scale, g_per_lsb)
    per_256 = ", ".join(f"{256_000 * value:+.0f}" for value in g_per_lsb)
    raise OddOffsets(
        f"256 counts in the offset registers at 0x{place[0]:02x} have an effect of {per_256} mg; known chips have 125"
        " or 62.5",
        "use the calibration's files: a correction in these registers would be wrong",
    )
