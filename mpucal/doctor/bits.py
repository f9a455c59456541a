"""Bits of the accelerometer's words that do not move.

A board at rest shows one place of the range, and there a bit that is stuck may do no harm. So the offset registers move
the reading by each power of two: where a bit is stuck, the reading is off by what the bit stands for.
"""

from __future__ import annotations

import numpy as np

from ..chip import registers as reg
from ..chip.families import Part
from ..chip.offset_response import OffsetResponse
from ..chip.offsets import OffsetRegisters, restoring, shift_words
from ..chip.port import Port
from ..chip.quick_measure import AFS_SEL, TemporaryMeasurement
from ..data import Vector
from .dead import REPLACE, STUCK_BITS
from .finding import Finding, Mark

# the lower ones move with the noise, or show as a dead axis; by the highest a reading goes through zero
STEPS = tuple(range(8, 15))
# of a step: its scale is measured; and in counts: what noise leaves, and a board that lay still
TOLERANCE, NEARLY = 0.02, 64.0


def examine_bits(
    port: Port, measurement: TemporaryMeasurement, part: Part, response: OffsetResponse
) -> tuple[Finding, int]:
    """Which high bits of x, y and z do not move, and of how many axes; the registers hold afterwards what they held.

    Raises
    ------
    BusError : a transfer failed. ChipError : the board moves, or the old words could not be restored.
    """
    lsb_per_g = reg.ACCEL_LSB_PER_G[AFS_SEL] * part.accel_sensitivity
    old = OffsetRegisters.read(port, response.place)
    before = measurement.rest()
    away = np.where(before > 0, 1.0, -1.0)
    missed = []
    with restoring(port, old):
        for bit in STEPS:
            step = 2.0**bit / lsb_per_g * (away if bit < STEPS[-1] else -away)
            words = shift_words(old.words, step / response.g_per_lsb)
            old.with_words(words).write(port)
            shown = (measurement.rest() - before) * lsb_per_g
            missed.append(_missed(shown, lsb_per_g * response.g_per_lsb * np.subtract(words, old.words)))
    worst = np.array(missed).max(0)
    data = {"missed_counts": worst.tolist()}
    by_axis = zip("xyz", worst, strict=True)
    stuck = [f"bit {round(np.log2(counts))} of accelerometer {axis}" for axis, counts in by_axis if counts]
    none = f"none of {STEPS[0]} to {STEPS[-1] + 1} of the accelerometer"
    if not stuck:
        return Finding(STUCK_BITS, Mark.OK, none, "", data), 0
    what = f"{', '.join(stuck)} {'does' if len(stuck) == 1 else 'do'} not move"
    return Finding(STUCK_BITS, Mark.BAD, what, REPLACE, data), len(stuck)


def _missed(shown: Vector, meant: Vector) -> Vector:
    """(3,) counts by which a reading missed; 0 where it did not."""
    away = np.abs(shown - meant)
    return np.where(away > TOLERANCE * np.abs(meant) + NEARLY, away, 0.0)
