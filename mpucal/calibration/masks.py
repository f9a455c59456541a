"""Samples that are marked or replaced, since they are not measurements: spikes, clipped ones, and steps across gaps."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from ..data import ACCEL_RANGES_G, GAP_INTERVALS, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Mask, Recording, Vector
from ..kernel import _kernel
from ..origin import Origin
from ..rests.flat import Flat
from ..rests.intervals import statistics, true_runs
from ..rests.limits import LEAST_TURN_RAD, MOVING_RAD_S
from ..rests.windows import WINDOW_S
from .problem import Series
from .rotation import cross_rows, lengths, shortest_turns, turned, units
from .words import ODDS

ACC_RANGES, GYRO_RANGES = STANDARD_GRAVITY_MPS2 * np.array(ACCEL_RANGES_G), np.deg2rad(GYRO_RANGES_DPS)
RANGE_TOLERANCE = 2e-3
# Fewer samples in a row that are equal, or on a straight line, may be so by chance.
SHORTEST_RUN = 8

CLIPPED_R_SCALE = 1e4
GAP_ANGLE_VARIANCE = 1.0  # rad^2 a second: the turn across a long gap is unknown
BRIDGED_S = 0.25  # longest gap across which a hand's rate is interpolated; its error is tried out so far on both sides
CLIPPED_TURN_SD = 0.3  # of the turn that a run of clipped rates hides: a hand's moves of several forms err by less
SMOOTH_S = 0.02  # time over which the slope of the rates, an angular acceleration, is measured

# After a gap with a larger uncertainty of the turn, the filter's linear correction falls short of the turn: so many
# samples more are allowed to correct it.
LOST_RAD, SETTLING = 0.2, 5

LINE_TOLERANCE = 1e-6

# A simulated board was reset if gravity turns far within a step, without a rate, and in none of the NEIGHBOURS steps on
# both sides; gravity is then that of the flat segment, up to the share BACK.
NEIGHBOURS, BACK = 4, 0.02


def _without_spikes(recording: Recording) -> Vector:
    """Return the rates without spikes: each is replaced by the mean of the samples before and after it.

    A spike is one wrong reading of one axis. A damaged word of a file leaves one; no board moves like that. The chip's
    own spikes are repaired before, by its decoder (chip/bit_flips.py). A spike of the acceleration stays: it may be a
    knock, to which the fit gives less weight.
    """
    gyr = recording.gyr
    at, axis = _kernel.spikes(np.ascontiguousarray(recording.acc), np.ascontiguousarray(gyr)).astype(np.intp).T
    if not len(at):
        return gyr
    mended = gyr.copy()
    mended[at, axis] = 0.5 * (gyr[at - 1, axis] + gyr[at + 1, axis])
    return mended


def with_masks(recording: Recording) -> Recording:
    """Return the recording without spikes of its rates, and with its gaps and clipped samples marked.

    This is the first step of every use of a recording; the marks of its source stay.
    """
    recording = _without_zeros(recording)
    dt = np.diff(recording.t, prepend=recording.t[0])
    # An autopilot's stream loses single packets, and its source marks longer pauses itself. Its values are rounded, and
    # repeat without being clipped: no hand reaches the end of their range.
    of_a_chip = recording.sensor.origin is not Origin.VEHICLE
    paused = of_a_chip & (dt > GAP_INTERVALS / recording.rate_hz)
    # A chip whose range is known does not clip at another one.
    acc_g, gyro_dps = recording.sensor.accel_range_g, recording.sensor.gyro_range_dps
    acc_ranges = ACC_RANGES if acc_g is None else np.array([acc_g]) * STANDARD_GRAVITY_MPS2
    gyro_ranges = GYRO_RANGES if gyro_dps is None else np.deg2rad([gyro_dps])
    marked = replace(
        recording,
        gap=recording.gap | paused | _on_a_line(recording.gyr, recording.t),
        acc_clipped=recording.acc_clipped | (of_a_chip & _at_the_rail(recording.acc, acc_ranges)),
        gyr_clipped=recording.gyr_clipped | (of_a_chip & _at_the_rail(recording.gyr, gyro_ranges, recording)),
    )
    for run in stuck_readings(marked, "gyr"):
        marked.gap[run.first : run.last] = True
    for axis, first, last in stuck_readings(marked, "acc"):
        column, value = recording.acc[:, axis], recording.acc[first, axis]
        # An axis that repeats its largest or smallest value, and reaches it at another time too, is clipped.
        if value in (column.min(), column.max()) and np.count_nonzero(column == value) > last - first:
            marked.acc_clipped[first - 1 : last - 1] = True
    return replace(marked, gyr=_beyond_range(replace(marked, gyr=_without_spikes(recording))))


def _beyond_range(recording: Recording) -> Vector:
    """Return the rates (n, 3), short runs of clipped ones replaced by what the slopes on both sides suggest."""
    if not recording.gyr_clipped.any():
        return recording.gyr
    gyr = recording.gyr.copy()
    n, longest = max(round(SMOOTH_S * recording.rate_hz), 1), BRIDGED_S * recording.rate_hz
    for column in gyr.T:
        for rail in (column.max(), column.min()):
            for first, last in true_runs(recording.gyr_clipped & (column == rail)).tolist():
                if 1 < last - first < longest and first > n and last + n < len(column):
                    beyond = _cubic(recording.t, column, (first - 1, last), n)
                    column[first:last] = np.maximum(beyond, rail) if rail > 0.0 else np.minimum(beyond, rail)
    return gyr


def _cubic(t: Vector, values: Vector, ends: tuple[int, int], n: int) -> Vector:
    """Return values between two samples by a cubic through both, with the slopes of n samples on both sides."""
    begin, end = ends
    (before, first, last, after), seconds = values[[begin - n, begin, end, end + n]], t[end] - t[begin]
    rise, fall = (first - before) / (t[begin] - t[begin - n]), (after - last) / (t[end + n] - t[end])
    x, slope = (t[begin + 1 : end] - t[begin]) / seconds, (last - first) / seconds
    bend = (rise - slope) * (1.0 - x) - (fall - slope) * x
    return np.asarray(first + seconds * x * (slope + (1.0 - x) * bend))


def _hidden_by_range(recording: Recording) -> Vector:
    """Return the variance (n,) [rad^2 an axis] of the turn in each step of a run of clipped rates.

    It is that of the turn by which the rates in the run exceed those at its ends; in a long run the turn is unknown.
    """
    t, gyr, variance = recording.t, recording.gyr, np.zeros(len(recording))
    for first, last in true_runs(recording.gyr_clipped).tolist():
        steps = slice(first, min(last + 1, len(t)))
        seconds = float(t[steps][-1] - t[max(first - 1, 0)])
        ends = 0.5 * (gyr[max(first - 1, 0)] + gyr[steps][-1])
        hidden = CLIPPED_TURN_SD * np.linalg.norm(gyr[first:last].mean(axis=0) - ends) * seconds
        if last - first >= BRIDGED_S * recording.rate_hz:
            hidden = max(hidden, np.sqrt(GAP_ANGLE_VARIANCE * seconds))
        variance[steps] += hidden**2 / len(variance[steps])
    return variance


def _without_zeros(recording: Recording) -> Recording:
    """Return the recording with gaps where a sample was not read, so that all of its readings are zero.

    Such a sample is interpolated. Also the samples before a gyroscope began, whose rates are zero, are gaps.
    """
    moves = lengths(recording.gyr) != 0.0
    read = moves | (lengths(recording.acc) != 0.0)
    late = _late_rates(recording, moves, read)
    if not read.any() or (read.all() and not late):
        return recording
    gap = recording.gap | ~read | np.append(False, ~read[:-1])
    gap[:late] = True
    acc, gyr = (
        np.stack([np.interp(recording.t, recording.t[read], column[read]) for column in values.T], axis=1)
        for values in (recording.acc, recording.gyr)
    )
    return replace(recording, acc=acc, gyr=gyr, gap=gap)


def _late_rates(recording: Recording, moves: Mask, read: Mask) -> int:
    """Return the number of samples before a gyroscope began, while the board rested; 0 if it was there from the start.

    A board that was simulated without noise has rates of zero, too, in each rest. But its rates are zero until it
    begins to turn: then gravity moves, or the first rates are small.
    """
    begins = int(moves.argmax())
    if begins == 0 or (read & ~moves)[begins:].any() or not np.ptp(recording.acc[:begins], axis=0).any():
        return 0
    sizes = lengths(recording.gyr[begins : begins + 2 * SHORTEST_RUN])
    half_second = max(round(WINDOW_S * recording.rate_hz), 1)
    before, after = recording.acc[:begins].mean(0), recording.acc[begins : begins + half_second].mean(0)
    rests = np.linalg.norm(after - before) < BACK * np.linalg.norm(before) and 5.0 * sizes[0] > np.median(sizes)
    return begins if rests else 0


def find_reset(recording: Recording, flat: Flat) -> int | None:
    """Return the first sample after a simulator was reset: the board lies flat again within one step, without a rate.

    None is returned where it was not.
    """
    acc, rate = recording.acc[flat.last :], recording.gyr[flat.last :] - flat.b_omega
    dt, steps, gravity = np.diff(recording.t[flat.last :]), np.diff(acc, axis=0), np.linalg.norm(flat.y)
    with np.errstate(all="ignore"):
        # an upper bound, which is replaced by the angle itself where it is large
        missed = (lengths(rate)[1:] * lengths(acc)[:-1] * dt + lengths(steps)) / gravity
        far = np.flatnonzero(missed > LEAST_TURN_RAD)
        missed[far] = lengths(cross_rows(rate[far + 1], acc[far]) * dt[far, None] + steps[far]) / gravity
        for i in far[(missed[far] > LEAST_TURN_RAD) & ~recording.gap[flat.last + 1 :][far]]:
            around, after = missed[max(i - NEIGHBOURS, 0) : i + NEIGHBOURS + 1], acc[i + 1 : i + 1 + NEIGHBOURS].mean(0)
            is_back = np.linalg.norm(after - flat.y) < BACK * np.linalg.norm(flat.y)
            if is_back and np.count_nonzero(around > LEAST_TURN_RAD) == 1:
                return flat.last + int(i) + 1
    return None


def mask(series: Series, recording: Recording, flat: Flat) -> Series:
    """Return the series with the noise of its masks: R of clipped accelerations, extra Q of gaps and clipped rates."""
    last = flat.last
    gap, acc, gyr = recording.gap[last:], recording.acc_clipped[last:], recording.gyr_clipped[last - 1 :]
    if not (gap.any() or acc.any() or gyr.any()):
        return series
    rates, variance = _bridged(recording)
    q_extra = variance[last:].copy()
    # Nothing is known of the rate in a long gap: it counts as zero.
    omega = np.where(gap[:, None], np.where(np.isnan(rates[last:]), flat.b_omega, rates[last:]), series.omega)
    up = units(recording.acc[last - 1 :])
    lost = np.flatnonzero(q_extra > LOST_RAD**2)
    for settling in range(1, SETTLING + 1):
        q_extra[lost[lost < len(q_extra) - settling] + settling] += LOST_RAD**2
    # gravity shows the turn, for which a linear correction may be too large
    shown = lost[up[lost].any(axis=1) & up[lost + 1].any(axis=1)]
    omega[shown] = flat.b_omega - shortest_turns(up[shown], up[shown + 1]) / series.dt[shown, None]
    q_extra += _hidden_by_range(recording)[last:]
    return replace(series, omega=omega, r_scale=np.where(acc, CLIPPED_R_SCALE, 1.0), q_extra=q_extra)


def _bridged(recording: Recording) -> tuple[Vector, Vector]:
    """Return mean rates (n, 3), and the variance (n,) [rad^2 an axis] of the turn, of each step in a gap.

    Across a short gap the rates are interpolated. The error of that is the largest one that interpolation makes over
    intervals of the same length beside the gap, where the rates are known. The rates in a longer gap are NaN. A step in
    no gap has NaN and 0.
    """
    t, gyr, gap = recording.t, recording.gyr, recording.gap
    dt, reach = np.diff(t, prepend=t[0]), round(BRIDGED_S * recording.rate_hz)
    rates, variance = np.full_like(gyr, np.nan), np.where(gap, GAP_ANGLE_VARIANCE * np.minimum(dt, 1e3), 0.0)
    turned = np.cumsum(0.5 * dt[:, None] * (gyr + gyr[np.maximum(np.arange(len(t)) - 1, 0)]), axis=0)
    gaps = np.cumsum(gap)
    for first, last in true_runs(gap).tolist():
        before, after = first - 1, last - 1
        n = max(round((t[after] - t[before]) * recording.rate_hz), 2)
        if before < 0 or n > reach:
            continue
        beside = np.arange(before - n - reach, after + reach)
        beside = beside[(beside >= 0) & (beside < len(t) - n) & ((beside <= before - n) | (beside >= after))]
        beside = beside[gaps[beside + n] == gaps[beside]]
        if not len(beside):
            continue
        to = beside + n
        missed = turned[to] - turned[beside] - 0.5 * (t[to] - t[beside])[:, None] * (gyr[to] + gyr[beside])
        share = dt[first:last] / (t[after] - t[before])
        middle = np.cumsum(share) - 0.5 * share
        rates[first:last] = gyr[before] + middle[:, None] * (gyr[after] - gyr[before])
        variance[first:last] = share * min(float(np.sum(missed**2, axis=1).max()) / 3.0, variance[first:last].sum())
    return rates, variance


def _run_lengths(mask: Mask) -> Vector:
    """Return for each sample (n,) the length of the run of equal values that it is in."""
    edges = np.flatnonzero(np.concatenate([[True], mask[1:] != mask[:-1], [True]]))
    return np.repeat(np.diff(edges), np.diff(edges)).astype(np.float64)


def _on_a_line(values: Vector, t: Vector) -> Mask:
    """Return (n,) True for samples that were interpolated: while the board turns, all axes follow straight lines."""
    dt, straight = np.diff(t), np.ones(max(len(t) - 2, 0), bool)
    turns = ~straight
    for column in values.T:
        slope = np.diff(column) / dt
        steep = np.abs(slope[1:])
        straight &= np.abs(np.diff(slope)) <= LINE_TOLERANCE * steep
        if not straight.any():  # the case of nearly every recording, which saves the time for the other axes
            return np.zeros(len(values), bool)
        turns |= steep > 0
    if 2 * np.count_nonzero(straight) > len(straight):  # the data are computed, and have no noise anywhere
        return np.zeros(len(values), bool)
    drawn = np.zeros(len(values), bool)
    for first, last in true_runs(straight & turns).tolist():
        if last - first >= SHORTEST_RUN:
            drawn[first + 1 : last + 2] = True
    return drawn


class Stuck(NamedTuple):
    """Samples first..last-1, in which the readings of `axis` repeat while the board turns."""

    axis: int
    first: int
    last: int


def stuck_readings(recording: Recording, sensor: Literal["acc", "gyr"]) -> list[Stuck]:
    """Find readings that repeat while the board turns, for longer than by chance, though they are within the range."""
    if recording.sensor.origin is Origin.VEHICLE:
        return []  # its stream is rounded, and repeats
    values, clipped, stuck = getattr(recording, sensor), getattr(recording, f"{sensor}_clipped"), []
    swings = LEAST_TURN_RAD * STANDARD_GRAVITY_MPS2
    for axis, column in enumerate(values.T):
        same = column[1:] == column[:-1]
        # Coarse readings repeat often, and rates most often in a long rest, which a recording begins with.
        longest = max(map(_longest_by_chance, (same,) if sensor == "acc" else (same[: max(len(same) // 20, 50)], same)))
        if not same.any() or _run_lengths(same)[same].max() < longest:
            continue
        for first, last in true_runs(same).tolist():
            if last - first < longest or clipped[first]:
                continue
            # The board turns if gravity moves; for a gyroscope also if a rate is far from that at rest, or one changes.
            # If both sensors froze, the sample after that shows the motion. It does not count for an accelerometer,
            # which may be shaken there.
            end = last + (2 if sensor == "gyr" else 1)
            is_turning = np.ptp(recording.acc[first:end], axis=0).max() > swings
            if sensor == "gyr":
                changed = np.ptp(values[first : last + 1], axis=0).max()
                is_turning |= max(changed, abs(column[first] - column[0])) > MOVING_RAD_S
                is_long = last - first >= WINDOW_S * recording.rate_hz
                is_turning &= not (is_long and _explains_gravity(recording, first, last))
            if is_turning:
                stuck.append(Stuck(axis, first + 1, last + 2))
    return stuck


def _longest_by_chance(same: Mask) -> float:
    """Return the greatest number of readings in a row that repeat by chance, at least SHORTEST_RUN.

    same : (n,) True for a reading that repeats the one before.
    """
    share = (np.count_nonzero(same) + 1) / (len(same) + 2)
    return max(-float(np.log(ODDS * len(same)) / np.log(share)), SHORTEST_RUN)


def _at_the_rail(values: Vector, ranges: Vector, turned_by: Recording | None = None) -> Mask:
    """Return (n,) True where an axis is clipped: it repeats its largest or smallest value.

    At the end of one of `ranges` two samples are enough. Elsewhere a range is not known, and the value must repeat more
    often than by chance. Clipped readings are equal to the largest value more often than they are just below it; at a
    slow peak of coarse readings it is the other way round.

    turned_by : recording whose rates these are. They may stay the same without being clipped, as a machine's do. At
        the end of an unknown range they are far from the others, and mostly do not explain how gravity turned.
    """
    clipped = np.zeros(len(values), bool)
    for column in np.ascontiguousarray(values.T):
        for rail in (column.max(), column.min()):
            at, tolerance = column == rail, RANGE_TOLERANCE * abs(rail)
            if np.count_nonzero(at) == 1:
                continue
            is_cut_off = 2 * np.count_nonzero(at) > np.count_nonzero(np.abs(column - rail) <= tolerance)
            known = is_cut_off and bool((np.abs(np.abs(rail) / ranges - 1.0) < RANGE_TOLERANCE).any())
            if not known and np.count_nonzero(at[1:] & at[:-1]) >= _longest_by_chance(np.diff(column) == 0.0):
                if turned_by is None:
                    known = is_cut_off and _is_noisy(column, tolerance)
                else:
                    known = _is_motion(column, rail) and not _is_steady(turned_by, at)
            if known:
                clipped |= at
    return clipped


def _is_motion(column: Vector, value: float) -> bool:
    """Return True if a rate is so far from the median of its column that only motion can explain it.

    A value with which the recording begins is that of a rest, even if most others are of a steady turn.
    """
    median = np.median(column)
    return bool(value != column[0] and abs(value - median) > 20.0 * np.median(np.abs(column - median)) + 1e-9)


def _is_steady(recording: Recording, at: Mask) -> bool:
    """Return True if the rates explain how gravity turned in most of the long runs, shorter pauses among them."""
    runs, half_second = true_runs(at), WINDOW_S * recording.rate_hz
    apart = np.flatnonzero(runs[1:, 0] - runs[:-1, 1] > half_second) + 1
    ends = [(near[0, 0], near[-1, 1]) for near in np.split(runs, apart)]
    explained = [_explains_gravity(recording, first, last) for first, last in ends if last - first >= half_second]
    return 2 * sum(explained) > len(explained)


def _explains_gravity(recording: Recording, first: int, last: int) -> bool:
    """Return True if the rates of samples first..last-1, of half a second or more, turn gravity as it turned.

    So do coarse rates that repeat as a machine turns at a constant rate, and no clipped or frozen ones. The bias is the
    mean rate of the recording's first half second. Errors of scale and axes may miss a tenth of the turn.
    """
    n = max(round(WINDOW_S * recording.rate_hz), 2)
    pieces = min(max((last - first) // (2 * n), 1), SHORTEST_RUN)
    at = np.linspace(first, last - 1, pieces + 1).astype(np.intp)
    around = np.clip(np.stack([at - n // 8, at + n // 8 + 1], axis=1), 0, len(recording))
    up = units(statistics(recording.acc, around)[0])
    t, rates = recording.t[first:last], recording.gyr[first:last] - recording.gyr[:n].mean(axis=0)
    steps = np.diff(t, prepend=t[0])[:, None] * rates
    carried = turned(-steps, np.stack([at[:-1], at[1:]], axis=1) + 1 - first) @ up[:-1, :, None]
    return bool(lengths(carried[:, :, 0] - up[1:]).sum() < 0.1 * lengths(steps).sum())


def _is_noisy(column: Vector, tolerance: float) -> bool:
    """Return True if most readings differ from the one before, and two of the smallest steps are within tolerance."""
    steps = np.abs(np.diff(column))
    return bool(2 * np.count_nonzero(steps) > len(steps) and 2.0 * steps[steps > 0.0].min() < tolerance)
