"""Check of the bits of the readings: an axis whose low or high bits never change.

The counts are recovered where the range is known, or where all values are whole counts of one of the chip's ranges (16
bits, as the MPU-6050 and its successors have). Where that fails, the steps of an axis are compared with those of the
others. A sensor that is coarse on all axes is no fault.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...data import ACCEL_COUNTS, ACCEL_RANGES_G, GYRO_COUNTS, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Vector
from ...reasons import Reason, reason
from ..evidence import Evidence
from .unusable import dead_accelerometer, dead_gyroscope

# Low bits are dead if so many more never change on an axis than on all axes; if so many never change on all axes, it is
# no coarse sensor.
DEAD_BITS, DEAD_BITS_OF_ALL = 3, 7
# Dead bits are looked for in pieces, as they may die midway; some of the changes in a piece may be errors of a bus.
MOST_PIECES, SHORTEST_PIECE_S, FEWEST_CHANGES, SHARE_OF_ERRORS = 64, 2.0, 12, 0.1
# A stuck bit removes values from the middle of the range that is passed; a low one does so in many places.
SIGN, OF_ALL_VALUES, FEWEST_PLACES = 15, 0.9, 16
LOW_BITS, HIGH_BITS = range(1, 8), range(8, SIGN + 1)
# A bit that died midway on a bus with errors: share of errors, leaps over the bit, share of samples on either side.
MOST_ERRORS, FEWEST_LEAPS, STAYS = 0.005, 3, 0.05
# Where the range is not known: how many steps of another axis make a step that is odd, and how exactly.
ODD_STEPS, EXACTLY, FEWEST_VALUES, MOST_SAMPLES = 8.0, 0.02, 6, 20_000
# A smaller step [m/s^2, rad/s] may be that of a float32, which is coarser the larger a value is.
LEAST_ODD_STEP = 1e-3
# The rounding of an axis refuses a calibration beyond so many claimed uncertainties, or these limits.
HONEST_STD, MOST_MPS2, USABLE_RAD_S = 2.0, 0.1, np.deg2rad(0.5)

Counts = NDArray[np.int64]


class Low(NamedTuple):
    """Low bits of an axis that never change: their number, the sample from which on, and the step that they leave."""

    axis: int
    bits: int
    first: int
    step: float


def bits_stuck(e: Evidence) -> Reason | None:
    """Find an axis of either sensor whose low or high bits never change."""
    if dead_accelerometer(e) is not None or dead_gyroscope(e) is not None:
        return None
    acc_range, gyro_range = e.recording.sensor.accel_range_g, e.recording.sensor.gyro_range_dps
    acc_lsbs = [g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS for g in ([acc_range] if acc_range else ACCEL_RANGES_G[::-1])]
    gyr_lsbs = [np.deg2rad(w / GYRO_COUNTS) for w in ([gyro_range] if gyro_range else GYRO_RANGES_DPS[-2:0:-1])]
    most = MOST_MPS2 if e.uncertainty is None else min(MOST_MPS2, HONEST_STD * e.uncertainty.rms_mps2)
    return _stuck(e, e.recording.acc, acc_lsbs, "accelerometer", "m/s^2", most) or _stuck(
        e, e.recording.gyr, gyr_lsbs, "gyroscope", "rad/s", USABLE_RAD_S
    )


def _stuck(e: Evidence, values: Vector, lsbs: Iterable[float], sensor: str, unit: str, most: float) -> Reason | None:
    lsb, counts = next(((lsb, whole) for lsb in lsbs if (whole := _counts(values, lsb)) is not None), (0.0, None))
    if counts is None:
        low = _odd_steps(values)
    else:
        one, low = _stuck_bit(counts, e.recording.gap, HIGH_BITS), _stuck_low(counts, lsb, e.recording.rate_hz)
        one = one or (_stuck_bit(counts, e.recording.gap, LOW_BITS) if low is None else None)
        if one is not None:
            axis, bit = one
            return reason("bits_stuck", "high", sensor=sensor, axis="xyz"[axis], bit=bit)
    if low is None:
        return None
    seconds = float(e.recording.t[low.first] - e.recording.t[0])
    return reason(
        "bits_stuck",
        "low",
        0.5 * low.step > most,
        sensor=sensor,
        axis="xyz"[low.axis],
        bits=low.bits,
        when=f" from {seconds:.0f} s on" if low.first else "",
        step=low.step,
        unit=unit,
    )


def _counts(values: Vector, lsb: float) -> Counts | None:
    """Return `values` (n, 3) as counts of `lsb`; None where those are not integers of 16 bits."""
    scaled = values / lsb
    counts = np.rint(scaled)
    # Rates that were not measured are NaN, and fail the comparison.
    if not (np.abs(scaled - counts).max() <= EXACTLY and np.abs(counts).max() <= ACCEL_COUNTS):
        return None
    return counts.astype(np.int64)


def _stuck_low(counts: Counts, lsb: float, rate_hz: float) -> Low | None:
    """Return the axis with the most low bits that never change."""
    changed = counts[1:] ^ counts[:-1]
    # The lowest bit that changes; 63, which is none of a word, where nothing changes.
    lowest = np.where(changed == 0, 63, np.log2(np.maximum(changed & -changed, 1))).astype(int)
    size = max(round(SHORTEST_PIECE_S * rate_hz), len(lowest) // MOST_PIECES, 1)
    pieces = [lowest[first : first + size] for first in range(0, len(lowest), size)]
    dead = np.array([[_dead_bits(piece[:, axis]) for axis in range(3)] for piece in pieces])
    known = dead >= 0
    if not known.any():
        return None
    common = int(dead[known].min())
    least = 0 if common >= DEAD_BITS_OF_ALL else common
    stuck = known & (dead >= least + DEAD_BITS)
    if not stuck.any():
        return None
    axis = int(np.where(stuck, dead, -1).max(0).argmax())
    first, bits = int(stuck[:, axis].argmax()), int(dead[stuck[:, axis], axis].min())
    # The pieces before the first one with dead bits may have too few changes to tell.
    first = 0 if not known[:first, axis].any() else first
    return Low(axis, bits, first * size, lsb * 2.0**bits)


def _dead_bits(lowest: NDArray[np.int_]) -> int:
    """Return the number of low bits that never change in a piece, but for errors; -1 of too few changes."""
    moved = np.sort(lowest[lowest < 63])
    return int(moved[int(SHARE_OF_ERRORS * len(moved))]) if len(moved) >= FEWEST_CHANGES else -1


def _stuck_bit(counts: Counts, gap: NDArray[np.bool_], bits: range) -> tuple[int, int] | None:
    """Return (axis, bit) of a bit that is constant though lower ones change and values on both sides are passed."""
    halves = [part for part in (counts[: len(counts) // 2], counts[len(counts) // 2 :]) if not gap.any() and len(part)]
    for part in (counts, *halves):
        moved = np.bitwise_or.reduce(part ^ part[0], axis=0)
        # across a gap, as between files of single faces, no value is passed
        pieces = np.split(part, np.flatnonzero(gap)) if part is counts else [part]
        passed = np.max([np.ptp(piece, axis=0) for piece in pieces if len(piece)], axis=0)
        for axis in range(3):
            for bit in bits:
                enough = 2 ** (bit + 1) if bit < SIGN else OF_ALL_VALUES * 2**SIGN
                lower = moved[axis] & (1 << bit) - 1
                if moved[axis] >> bit & 1 or not lower or passed[axis] < enough:
                    continue
                if bit in HIGH_BITS or len(np.unique(part[:, axis] >> (bit + 1))) >= FEWEST_PLACES:
                    return axis, bit
    last = len(counts) // 2
    places = ((axis, bit) for axis in range(3) for bit in bits if bit in HIGH_BITS and bit < SIGN)
    return next((at for at in places if _leaps(counts[last:, at[0]], gap[last:], at[1])), None)


def _leaps(counts: Counts, gap: NDArray[np.bool_], bit: int) -> bool:
    """Return True if values (n,) leap again and again over those with another value of a bit, and stay on both sides.

    Leaps across a gap do not count, and a few samples may be errors of a bus.
    """
    with_it = int(np.count_nonzero(counts >> bit & 1))
    errors = min(with_it, len(counts) - with_it)
    if errors > MOST_ERRORS * len(counts):
        return False
    side = counts >> (bit + 1)
    leaps = int(np.count_nonzero((side[1:] != side[:-1]) & ~gap[1:]))
    _, stays = np.unique(side, return_counts=True)
    return leaps > max(FEWEST_LEAPS, 10 * errors) and int(np.count_nonzero(stays > STAYS * len(counts))) > 1


def _odd_steps(values: Vector) -> Low | None:
    """Return the axis whose every value is a multiple of a step that is many times the step of another axis."""
    part = values[:: max(len(values) // MOST_SAMPLES, 1)]
    if all(_is_fine(column) for column in part.T):
        return None  # nearly every recording ends here, without sorting its values
    unique = [np.unique(column) for column in part.T]
    if min(map(len, unique)) < FEWEST_VALUES:
        return None
    steps = np.array([float(np.diff(u).min()) for u in unique])
    axis = int(steps.argmax())
    finest = float(np.median(steps))
    places = (unique[axis] - unique[axis][0]) / steps[axis]
    if steps[axis] < max(ODD_STEPS * finest, LEAST_ODD_STEP) or np.abs(places - np.rint(places)).max() > EXACTLY:
        return None
    # Other axes may be as fine as a float, but a word has 16 bits.
    bits = min(round(float(np.log2(steps[axis]) - np.log2(finest))), SIGN)
    return Low(axis, bits, 0, steps[axis])


def _is_fine(column: Vector) -> bool:
    """Return True if some value differs from the one before it by less than an odd step."""
    change = np.abs(np.diff(column))
    return bool(np.any((change > 0.0) & (change < LEAST_ODD_STEP)))
