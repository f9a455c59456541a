"""Stuck bits of the accelerometer's words.

A board at rest shows one place of the range, where a stuck bit may do no harm. So the offset registers shift the
reading by each power of two: if a bit is stuck, the reading is wrong by the value of the bit.
"""

from __future__ import annotations

import numpy as np

from ..chip import registers as reg
from ..chip.families import Part
from ..chip.offset_response import MOTION_G, OffsetResponse
from ..chip.offsets import OffsetRegisters, restoring, shift_words
from ..chip.port import Port
from ..chip.quick_measure import AFS_SEL, TemporaryMeasurement
from ..errors import BoardMoved
from .dead_axes import REPLACE, STUCK_BITS
from .finding import Finding, Mark

# Lower bits move with the noise, or show as a dead axis; the highest step takes the reading through zero.
STEPS = tuple(range(8, 15))
# A reading may miss by this share of a step, the error of its measured scale, and by so many counts of noise.
TOLERANCE, NOISE_COUNTS = 0.02, 64.0


def examine_bits(
    port: Port, measurement: TemporaryMeasurement, part: Part, response: OffsetResponse
) -> tuple[Finding, int]:
    """Examine the high bits of x, y and z; return the finding and the number of axes with a stuck bit.

    The offset registers are restored afterwards.

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
            expected = lsb_per_g * response.g_per_lsb * np.subtract(words, old.words)
            miss = np.abs(shown - expected)
            missed.append(np.where(miss > TOLERANCE * np.abs(expected) + NOISE_COUNTS, miss, 0.0))
    if (np.abs(measurement.rest() - before) > MOTION_G).any():
        raise BoardMoved("the board moved while its bits were examined", "put it on a firm surface and let go of it")
    worst = np.array(missed).max(0)
    data = {"missed_counts": worst.tolist()}
    by_axis = zip("xyz", worst, strict=True)
    stuck = [f"bit {round(np.log2(counts))} of accelerometer {axis}" for axis, counts in by_axis if counts]
    what = f"{', '.join(stuck)} {'does' if len(stuck) == 1 else 'do'} not move"
    if not stuck:
        what = f"none of bits {STEPS[0]} to {STEPS[-1] + 1} of the accelerometer"
    return Finding.check(STUCK_BITS, not stuck, what, REPLACE, data, Mark.BAD), len(stuck)
