"""Check of the bits of which readings are made: an axis whose low or high bits never move.

Counts are known again where the range is known, or where all values are whole counts of one of the chip's (16 bits, as
the MPU-6050 and its successors have). Where they are not, the steps of an axis are compared with those of the others.
A sensor that is coarse on all axes is no fault.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ...reasons import Reason, reason
from ..evidence import Evidence
from .unusable import dead_accelerometer, dead_gyroscope

# PS-MPU-6000A r3.4, section 6: sensitivities at 16 bits
FULL_SCALE = 32768
ACCEL_RANGES_G, GYRO_RANGES_DPS = (16.0, 8.0, 4.0, 2.0), (2000.0, 1000.0, 500.0, 250.0)
# So many low bits more than those that no axis moves are dead; so many on all axes are no coarse sensor's any more.
DEAD_BITS, DEAD_BITS_OF_ALL = 3, 7
# They are looked for in pieces, as they may die midway; of the changes in a piece some may be errors of a bus.
MOST_PIECES, SHORTEST_PIECE_S, FEWEST_CHANGES, SHARE_OF_ERRORS = 64, 2.0, 12, 0.1
# A stuck bit takes values out of the middle of those that are passed; a low one does so in many places.
LOW_BITS, HIGH_BITS, SIGN, OF_ALL_VALUES, FEWEST_PLACES = range(1, 8), range(8, 16), 15, 0.9, 16
# Where a bit died midway, and a bus errs: errors among the samples, leaps over the bit, and samples on either side.
MOST_ERRORS, FEWEST_LEAPS, STAYS = 0.005, 3, 0.05
# Where the range is not known: how many steps of another axis make a step that is odd, and how exactly.
ODD_STEPS, EXACTLY, FEWEST_VALUES, MOST_SAMPLES = 8.0, 0.02, 6, 20_000
# Below this a step [m/s^2, rad/s] may be that of a float32, which is coarser the larger a value is.
LEAST_ODD_STEP = 1e-3
# beyond these an axis' rounding is no calibration's noise any more
HONEST_STD, MOST_MPS2, USABLE_RAD_S = 2.0, 0.1, np.deg2rad(0.5)

Counts = NDArray[np.int64]


class Low(NamedTuple):
    """Low bits that never move: of which axis, how many, from which sample on, and the step that they leave."""

    axis: int
    bits: int
    first: int
    step: float


def bits_stuck(e: Evidence) -> Reason | None:
    """An axis of either sensor whose low or high bits never move."""
    if dead_accelerometer(e) is not None or dead_gyroscope(e) is not None:
        return None
    acc_range, gyro_range = e.recording.sensor.accel_range_g, e.recording.sensor.gyro_range_dps
    acc_lsbs = [g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS for g in ([acc_range] if acc_range else ACCEL_RANGES_G)]
    gyr_lsbs = [np.deg2rad(w / GYRO_COUNTS) for w in ([gyro_range] if gyro_range else GYRO_RANGES_DPS)]
    most = MOST_MPS2 if e.sure is None else min(MOST_MPS2, HONEST_STD * e.sure.rms_mps2)
    return _stuck(e, e.recording.acc, acc_lsbs, "accelerometer", "m/s^2", most) or _stuck(
        e, e.recording.gyr, gyr_lsbs, "gyroscope", "rad/s", USABLE_RAD_S
    )


def _stuck(e: Evidence, values: Vector, lsbs: Iterable[float], sensor: str, unit: str, most: float) -> Reason | None:
    lsb, counts = next(((lsb, found) for lsb in lsbs if (found := _counts(values, lsb)) is not None), (0.0, None))
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
    """(n, 3) the counts of which `values` were made; None where they are no whole numbers of 16 bits."""
    scaled = values / lsb
    counts = np.rint(scaled)
    # rates that were not measured are NaN
    if not (np.abs(scaled - counts).max() <= EXACTLY and np.abs(counts).max() <= FULL_SCALE):
        return None
    return counts.astype(np.int64)


def _stuck_low(counts: Counts, lsb: float, rate_hz: float) -> Low | None:
    """The axis with the most low bits that never move."""
    changed = counts[1:] ^ counts[:-1]
    # the lowest bit that a change moves; of no change a bit that there is not
    lowest = np.where(changed == 0, 63, np.log2(np.maximum(changed & -changed, 1))).astype(int)
    size = max(round(SHORTEST_PIECE_S * rate_hz), len(lowest) // MOST_PIECES, 1)
    pieces = [lowest[first : first + size] for first in range(0, len(lowest), size)]
    dead = np.array([[_dead_bits(piece[:, axis]) for axis in range(3)] for piece in pieces])
    known = dead >= 0
    if not known.any():
        return None
    common = int(dead[known].min())
    least = 0 if common >= DEAD_BITS_OF_ALL else common
    found = known & (dead >= least + DEAD_BITS)
    if not found.any():
        return None
    axis = int(np.where(found, dead, -1).max(0).argmax())
    first, bits = int(found[:, axis].argmax()), int(dead[found[:, axis], axis].min())
    # before the first piece that shows it there may be others that do not say
    first = 0 if not known[:first, axis].any() else first
    return Low(axis, bits, first * size, lsb * 2.0**bits)


def _dead_bits(lowest: NDArray[np.int_]) -> int:
    """How many low bits the changes of a piece never move, but for errors; -1 where there are too few changes."""
    moved = np.sort(lowest[lowest < 63])
    return int(moved[int(SHARE_OF_ERRORS * len(moved))]) if len(moved) >= FEWEST_CHANGES else -1


def _stuck_bit(counts: Counts, gap: NDArray[np.bool_], bits: range) -> tuple[int, int] | None:
    """(axis, bit) that is the same throughout, though lower ones move, and values on both sides of it are passed."""
    halves = [part for part in (counts[: len(counts) // 2], counts[len(counts) // 2 :]) if not gap.any() and len(part)]
    for part in (counts, *halves):
        moved = np.bitwise_or.reduce(part ^ part[0], axis=0)
        passed = np.ptp(part, axis=0)
        for axis in range(3):
            for bit in bits:
                enough = 2 ** (bit + 1) if bit < SIGN else OF_ALL_VALUES * 2**SIGN
                lower = moved[axis] & (1 << bit) - 1
                if moved[axis] >> bit & 1 or not lower or passed[axis] < enough:
                    continue
                if bit in HIGH_BITS or len(np.unique(part[:, axis] >> (bit + 1))) >= FEWEST_PLACES:
                    return axis, bit
    last = len(counts) // 2
    found = ((axis, bit) for axis in range(3) for bit in bits if bit in HIGH_BITS and bit < SIGN)
    return next((at for at in found if _leaps(counts[last:, at[0]], gap[last:], at[1])), None)


def _leaps(counts: Counts, gap: NDArray[np.bool_], bit: int) -> bool:
    """Whether values (n,) leap over those with another value of a bit, again and again, and stay on both sides.

    Gaps and errors of a bus may lie between: leaps across a gap count for nothing, and a few samples may be errors.
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
    """The axis whose every value is a multiple of a step that is many times the step of another axis."""
    part = values[:: max(len(values) // MOST_SAMPLES, 1)]
    if all(_is_fine(column) for column in part.T):
        return None  # without a value sorted: this is nearly every recording
    unique = [np.unique(column) for column in part.T]
    if min(map(len, unique)) < FEWEST_VALUES:
        return None
    steps = np.array([float(np.diff(u).min()) for u in unique])
    axis = int(steps.argmax())
    finest = float(np.median(steps))
    places = (unique[axis] - unique[axis][0]) / steps[axis]
    if steps[axis] < max(ODD_STEPS * finest, LEAST_ODD_STEP) or np.abs(places - np.rint(places)).max() > EXACTLY:
        return None
    # of a word of 16 bits; what other axes hold beside it may be as fine as a number can be
    bits = min(round(float(np.log2(steps[axis]) - np.log2(finest))), SIGN)
    return Low(axis, bits, 0, steps[axis])


def _is_fine(column: Vector) -> bool:
    """Whether some value follows another by less than a step that is odd."""
    change = np.abs(np.diff(column))
    return bool(np.any((change > 0.0) & (change < LEAST_ODD_STEP)))
