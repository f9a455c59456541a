"""Samples that must not be believed as they stand: clipped ones, and steps across a gap, drawn through or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import ACCEL_RANGES_G, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Mask, Recording, Vector
from ..rests.flat import Flat
from .problem import Series
from .rotation import lengths

ACC_RANGES, GYRO_RANGES = STANDARD_GRAVITY_MPS2 * np.array(ACCEL_RANGES_G), np.deg2rad(GYRO_RANGES_DPS)
RANGE_TOLERANCE = 2e-3
FEWEST_AT_A_RANGE, FEWEST_ANYWHERE = 2, 8

CLIPPED_R_SCALE = 1e4
GAP_ANGLE_VARIANCE = 1.0  # rad^2 a second: nothing is known of how the board turned
CLIPPED_RATE_SD = 0.0015  # of |omega|, in a run of one: a longer one hides more of what lies beyond the range

# After a gap that long a correction, linear in the turn, falls short of it: the samples that follow correct it again.
LOST_RAD, SETTLING = 0.2, 5

LINE_TOLERANCE, SHORTEST_LINE = 1e-6, 8

# Of a rate that repeats while the board turns by so much [rad/s]: as long as chance makes at rest so rarely.
SHORTEST_REPEAT, BY_CHANCE, TURNING = 8, 1e-6, 0.3

GAP_INTERVALS = 2.5  # a longer time between samples than so many intervals is a gap

# Of a board that is back at once: how far gravity turns within a step beyond what the gyroscope tells, how much of that
# the steps before and after it may miss, and how near it is then to where it lay.
JUMP_RAD, BESIDE, NEIGHBOURS, BACK = np.deg2rad(5.0), 0.2, 4, 0.02
AROUND = np.array([step for step in range(-NEIGHBOURS, NEIGHBOURS + 1) if step])


def with_masks(recording: Recording) -> Recording:
    """The recording with its gaps and clipped samples marked, where its source did not already."""
    dt = np.diff(recording.t, prepend=recording.t[0])
    # An autopilot's stream comes by radio: its source says which pauses are more than packets lost here and there.
    # It is rounded as well, of a range that no hand reaches: values repeat without a rail.
    of_a_chip = recording.sensor.message is None
    paused = of_a_chip & (dt > GAP_INTERVALS * np.median(dt[1:]))
    # a chip whose range is known does not clip at another one
    acc_g, gyro_dps = recording.sensor.accel_range_g, recording.sensor.gyro_range_dps
    acc_ranges = ACC_RANGES if acc_g is None else np.array([acc_g]) * STANDARD_GRAVITY_MPS2
    gyro_ranges = GYRO_RANGES if gyro_dps is None else np.deg2rad([gyro_dps])
    gyr_clipped = recording.gyr_clipped | (of_a_chip & _at_the_rail(recording.gyr, gyro_ranges))
    stuck = of_a_chip & _stuck(recording.gyr, gyr_clipped)
    return replace(
        recording,
        gap=recording.gap | paused | _on_a_line(recording.gyr, recording.t) | stuck,
        acc_clipped=recording.acc_clipped | (of_a_chip & _at_the_rail(recording.acc, acc_ranges)),
        gyr_clipped=gyr_clipped,
    )


def reset(recording: Recording, flat: Flat) -> int | None:
    """The first sample after a simulator was reset; None where it was not.

    The board lies flat again at once, and no rate tells of the way.
    """
    acc, rate = recording.acc[flat.last :], recording.gyr[flat.last :] - flat.b_omega
    dt = np.diff(recording.t[flat.last :])[:, None]
    with np.errstate(all="ignore"):
        missed = lengths(np.diff(acc, axis=0) + np.cross(rate[1:], acc[:-1]) * dt) / np.linalg.norm(flat.y)
        at = np.flatnonzero((missed > JUMP_RAD) & ~recording.gap[flat.last + 1 :])
        at = at[(at >= NEIGHBOURS) & (at < len(missed) - NEIGHBOURS)]
        for i in at[(missed[at[:, None] + AROUND] < BESIDE * missed[at, None]).all(1)]:
            after = acc[i + 1 : i + 1 + NEIGHBOURS].mean(0)
            if np.linalg.norm(after - flat.y) < BACK * np.linalg.norm(flat.y):
                return flat.last + int(i) + 1
    return None


def mask(series: Series, recording: Recording, flat: Flat) -> Series:
    """The series with what its masks demand: R of clipped accelerations, extra Q of gaps and clipped rates."""
    last = flat.last
    gap, acc, gyr = recording.gap[last:], recording.acc_clipped[last:], recording.gyr_clipped[last - 1 :]
    if not (gap.any() or acc.any() or gyr.any()):
        return series
    clipped = gyr[:-1] | gyr[1:]
    rate2 = np.sum((series.omega - flat.b_omega) ** 2, axis=1)
    q_extra = np.where(gap, GAP_ANGLE_VARIANCE * np.minimum(series.dt, 1e3), 0.0)
    for i in np.flatnonzero(q_extra > LOST_RAD**2):
        q_extra[i + 1 : i + 1 + SETTLING] += LOST_RAD**2
    q_extra += clipped * _run_lengths(clipped) * (CLIPPED_RATE_SD * series.dt) ** 2 * rate2
    # the measured rates on both sides of a gap say nothing of what lies between
    omega = np.where(gap[:, None], flat.b_omega, series.omega)
    return replace(series, omega=omega, r_scale=np.where(acc, CLIPPED_R_SCALE, 1.0), q_extra=q_extra)


def _run_lengths(mask: Mask) -> Vector:
    """(n,) how many neighbours in a row share each sample's value, itself among them."""
    edges = np.flatnonzero(np.concatenate([[True], mask[1:] != mask[:-1], [True]]))
    return np.repeat(np.diff(edges), np.diff(edges)).astype(np.float64)


def _on_a_line(values: Vector, t: Vector) -> Mask:
    """(n,) True within straight lines that all axes follow exactly, and not at rest: somebody drew them."""
    dt, straight = np.diff(t), np.ones(max(len(t) - 2, 0), bool)
    turns = ~straight
    for column in values.T:
        slope = np.diff(column) / dt
        steep = np.abs(slope[1:])
        straight &= np.abs(np.diff(slope)) <= LINE_TOLERANCE * steep
        if not straight.any():  # nearly every recording: the other axes need not be asked
            return np.zeros(len(values), bool)
        turns |= steep > 0
    if 2 * np.count_nonzero(straight) > len(straight):  # computed data: nothing in them has noise
        return np.zeros(len(values), bool)
    straight &= turns
    edges = np.diff(np.concatenate([[False], straight, [False]]).astype(np.int8))
    drawn = np.zeros(len(values), bool)
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if last - first >= SHORTEST_LINE:
            drawn[first + 1 : last + 2] = True
    return drawn


def _stuck(values: Vector, clipped: Mask) -> Mask:
    """(n,) True where a rate within its range repeats while the board turns, longer than its noise at first lets it."""
    stuck = np.zeros(len(values), bool)
    for column in values.T:
        same = np.diff(column) == 0.0
        start = same[: max(len(same) // 20, 50)]
        by_chance = (np.count_nonzero(start) + 1) / (len(start) + 2)
        longest = max(np.log(BY_CHANCE / len(values)) / np.log(by_chance), SHORTEST_REPEAT)
        if not same.any() or _run_lengths(same)[same].max() < longest:
            continue
        edges = np.diff(np.concatenate([[False], same, [False]]).astype(np.int8))
        for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            # a rate that is far from rest, or others that change
            most = np.ptp(values[first : last + 1], axis=0).max()
            if last - first >= longest and not clipped[first] and max(most, abs(column[first] - column[0])) > TURNING:
                stuck[first + 1 : last + 2] = True
    return stuck


def _at_the_rail(values: Vector, ranges: Vector) -> Mask:
    """(n,) True where an axis repeats its largest magnitude exactly: few times at a chip's range, often elsewhere."""
    clipped = np.zeros(len(values), bool)
    for column in values.T:
        for rail in (column.max(), column.min()):
            at = column == rail
            if np.count_nonzero(at) < FEWEST_AT_A_RANGE:
                continue
            known = np.any(np.abs(np.abs(rail) / ranges - 1.0) < RANGE_TOLERANCE)
            runs = int(np.count_nonzero(at[1:] & at[:-1]))
            if known or (runs >= FEWEST_ANYWHERE and _beyond(column, rail)):
                clipped |= at
    return clipped


def _beyond(column: Vector, rail: float) -> bool:
    """Whether a value stands so far from the middle of its column that only motion can have brought it there."""
    middle = np.median(column)
    return bool(abs(rail - middle) > 20.0 * np.median(np.abs(column - middle)) + 1e-9)
