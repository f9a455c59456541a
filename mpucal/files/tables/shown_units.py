"""The units that samples show.

The step shows the unit of times, since sample rates lie between 5 Hz and 8 kHz; the median of |a|, which is gravity in
a recording that was turned by hand, shows that of accelerations; and how fast gravity turns shows that of rates, since
d(a)/dt = -w x a for a vector that is fixed in space.
"""

from __future__ import annotations

import math

import numpy as np

from ...chip.families import MPU6050
from ...clocks.stamps import LONGEST_STEP_S, SLOWEST_HZ
from ...data import ACCEL_COUNTS, GAP_INTERVALS, STANDARD_GRAVITY_MPS2, Vector
from .units import DAYS, QUANTITIES

# counts for 1 g, as powers of two: of 10 bits at ±2 g, and of 24 at ±2 g
FEWEST_PER_G, MOST_PER_G = 8, 22
# the units that samples show without a name; the others are too near to these, to counts, or to a magnetic field in uT
SHOWN = {
    "t": ("s", "ms", "us", "ns", "0.1ms", DAYS),
    "acc": ("m/s^2", "g", "mg"),
    "gyr": ("rad/s", "deg/s", "mdeg/s", "mrad/s", "deg/h"),
}
FASTEST_HZ = 8000.0
# m/s^2: whole numbers that are larger are counts
LARGEST_OF_SI = 300.0
# largest ratio of |a| and g, or its inverse: a sensor may have gains of 0.5 to 1.5, and 2048 counts are no cm/s^2
MOST_OF_G = 2.0
# the same where nothing else shows that it is gravity in a unit: not counts of 512 for 1 g in mg, or a field in gauss
MOST_LIKELY = 1.35
# the same of true and measured rate
MOST_TURNED = 1.65
# quartile distance of |a| over its median, beyond which it is not gravity
SCATTER = 0.45
# a rate to try on samples without times, and the rates of most loggers
ANY_HZ, LIKELY_HZ = 100.0, (4.0, 1100.0)
# samples over which shaking averages out: a few of its periods at the rates of most loggers
AVERAGED_SAMPLES = 100
# octaves: largest change of the sample rate in the second round
SETTLED_OCTAVES = 0.25
# the fastest rate of a hand and of usual sensors
FASTEST_RAD_S = 37.0
# samples of a quiet part; the least noise of a gyroscope, 0.0028 deg/s/sqrt(Hz) (ICM-42688-P) over 3 Hz; and the ratio
# of the speed at which gravity seems to turn, by noise, to that at which it turns
QUIET_SAMPLES, LEAST_NOISE_RAD_S, MOST_TURNED_MORE = 50, math.radians(0.005), 3.0
# share of half the range by which counts from the lowest may turn, or rest, about another point
OFF_CENTRE = 0.05
# larger numbers are not from a sensor in any unit; their squares are finite
LARGEST_NUMBER = 1e12
# the least duration of a recording that shows how gravity turns, in halves of TURN_S
LEAST_TURNS = 30
# s over which the change of gravity is taken, and the correlation with the rates that it needs at least
TURN_S, EXPLAINED = 0.2, 0.5


def time_unit(step: float, named: str = "") -> str:
    """Return the unit of times that lie `step` apart: `named` if plausible, else by the sample rate; or empty.

    A recording in a named unit is read even if it is too slow to calibrate.
    """
    if named and 1 / FASTEST_HZ <= step * QUANTITIES["t"][named] <= LONGEST_STEP_S:
        return named
    return _first_unit("t", "", step, 1 / FASTEST_HZ, 1 / SLOWEST_HZ)


def _first_unit(quantity: str, named: str, value: float, least: float, most: float) -> str:
    """Return the first unit in which a value is within limits in SI: `named`, or one that samples show; or empty."""
    likely = {unit: value * QUANTITIES[quantity][unit] for unit in (*filter(None, [named]), *SHOWN[quantity])}
    return next((unit for unit, si in likely.items() if least <= si <= most), "")


def acceleration_unit(acc: Vector, named: str = "") -> str:
    """Return the unit in which the median of (n, 3) accelerations is gravity; empty if none is.

    `named`, the unit in the file, is tried first. Without gravity, |a| of a hand scatters by more than half its median.
    """
    if not (np.abs(acc) < LARGEST_NUMBER).all():
        return ""
    size, scatter = typical_size(acc)
    if scatter > SCATTER * size:
        return ""
    return _first_unit("acc", named, size, STANDARD_GRAVITY_MPS2 / MOST_OF_G, STANDARD_GRAVITY_MPS2 * MOST_OF_G)


def mean_acceleration_unit(values: Vector) -> str:
    """Return the unit in which (n, 3) accelerations are gravity on average; empty if there is none."""
    whole = values[np.isfinite(values).all(axis=1)]
    return acceleration_unit(averaged(whole)) if len(whole) > 1 else ""


def quietest(values: Vector) -> Vector:
    """Return the part of (n, 3) samples that varies least, as a sensor at rest does."""
    width = min(len(values), QUIET_SAMPLES)
    parts = values[: len(values) // width * width].reshape(-1, width, 3)
    return np.asarray(min(parts, key=lambda part: float(part.std(axis=0).sum())))


def averaged(values: Vector) -> Vector:
    """Return means of adjacent samples (n, 3): shaking averages out, and gravity does not."""
    width = min(AVERAGED_SAMPLES, len(values) // 2)
    return np.column_stack([np.convolve(axis, np.full(width, 1 / width), "valid") for axis in values.T])


def typical_size(values: Vector) -> tuple[float, float]:
    """Return the median of the lengths of (n, 3) numbers, and the distance of their quartiles."""
    low, size, high = np.percentile(np.linalg.norm(values, axis=1), [25, 50, 75]).tolist()
    return size, high - low


def offset(values: Vector) -> Vector | None:
    """Return the centre (3,) of the sphere on which (n, 3) accelerations lie, if zero is outside; None otherwise.

    Each axis has to cover more than the radius, so that the sphere is determined, and not by noise or shocks alone;
    and the centre has to explain why the lengths vary about zero: those of a flight, or of a rest with shocks, do
    about any point.
    """
    with np.errstate(over="ignore"):
        squares = (values**2).sum(axis=1)
    if not np.isfinite(squares).all():  # LAPACK might never return
        return None
    x, *_ = np.linalg.lstsq(np.column_stack([2.0 * values, np.ones(len(values))]), squares, rcond=None)
    centre, means = x[:3], averaged(values)
    radius, scatter = typical_size(values - centre)
    cover, without_shocks = (float(np.ptp(of, axis=0).min()) for of in (values, means))
    left, all_of_it = (float(np.linalg.norm(of, axis=1).std()) for of in (means - centre, means))
    known = left < SCATTER * all_of_it and scatter < SCATTER * radius < min(SCATTER * cover, without_shocks)
    return centre if known and radius < float(np.linalg.norm(centre)) else None


def counts_per_g(size: float) -> int:
    """Return the counts for 1 g, of those that sensors have, that are nearest to an acceleration."""
    return 1 << min(max(round(math.log2(max(size, 1.0))), FEWEST_PER_G), MOST_PER_G)


def to_signed(values: Vector) -> Vector:
    """Return (n, 3) counts with their sign, if they were read as unsigned or count from the lowest value.

    Of another width than 16 bits, they only do so where gravity turns, or rates rest, about half the range.
    """
    most = float(values.max())
    if values.min() < 0 or not 2.0**FEWEST_PER_G <= most < LARGEST_NUMBER or not (values == np.rint(values)).all():
        return values
    half = 2.0 ** (int(most).bit_length() - 1)
    wrapped, shifted = np.where(values >= half, values - 2 * half, values), values - half
    # the wrong reading jumps from one end of the range to the other
    steps = [float(np.abs(np.diff(each, axis=0)).sum()) for each in (wrapped, values)]
    if steps[0] < steps[1]:
        return wrapped
    centre = offset(values)
    # a converter's counts for 1 g may be any number, and are named by the user
    of_converter = centre is not None and typical_size(shifted)[0] < 2.0 ** (FEWEST_PER_G - 0.5)
    centre = np.median(values, axis=0) if centre is None else centre
    near = bool((np.abs(centre - half) < OFF_CENTRE * half).all())
    return shifted if half == ACCEL_COUNTS or (near and not of_converter) else values


def are_counts(values: Vector) -> bool:
    """Return True if all values are whole numbers of 24 bits at most."""
    return bool((values == np.rint(values)).all() and np.abs(values).max() <= 2.0 ** (MOST_PER_G + 1))


def seem_counts(values: Vector) -> bool:
    """Return True if (n, 3) numbers are whole, and larger than in any other unit."""
    return len(values) > 0 and are_counts(to_signed(values)) and bool(np.abs(values).max() > LARGEST_OF_SI)


def rate_factor(t: Vector, acc: Vector, gyr: Vector) -> float | None:
    """Return the factor by which (n, 3) rates turn (n, 3) accelerations as these turn; None if it is not determined.

    Parameters
    ----------
    t : (n,) s. acc : in any unit. gyr : in rad/s if the factor is 1.
    """
    factor, correlation = turning(t, acc, gyr)
    return factor if correlation >= EXPLAINED else None


def turning(t: Vector, acc: Vector, gyr: Vector) -> tuple[float, float]:
    """Return the factor of rate_factor, and the correlation of both turnings, 0 if there is none.

    The factor is the ratio of their sizes: the hand's own acceleration disturbs both, so that the regression of one on
    the other would be too small.
    """
    # stamps of arrival may repeat
    dt = (float(np.median(np.diff(t))) or float(t[-1] - t[0]) / len(t)) if len(t) >= LEAST_TURNS else 0.0
    width = max(1, round(min(TURN_S / 2 / dt, len(t)))) if dt > 0.0 else len(t)
    if len(t) < LEAST_TURNS * width:
        return math.inf, 0.0
    kernel = np.full(width, 1.0 / width)
    smooth = np.column_stack([np.convolve(column, kernel, "same") for column in acc.T])
    rates = np.column_stack([np.convolve(column, kernel, "same") for column in gyr.T])
    # how it turned in a gap is unknown
    steps = np.cross(rates, smooth) * -np.minimum(np.gradient(t), GAP_INTERVALS * dt)[:, None]
    path = np.cumsum(steps, axis=0)
    inner = slice(width, len(t) - width)
    lag = 2 * width
    seen, predicted = (values[inner][lag:] - values[inner][:-lag] for values in (smooth, path))
    # a shake at the end would outweigh all turns before it
    lengths = np.linalg.norm(acc, axis=1)
    shaken = np.cumsum(np.abs(lengths - np.median(lengths)) > SCATTER * np.median(lengths))[inner]
    calm = shaken[lag:] == shaken[:-lag]
    if 2 * np.count_nonzero(calm) > len(calm):
        seen, predicted = seen[calm], predicted[calm]
    sizes, both = [math.sqrt(float((each**2).sum())) for each in (seen, predicted)], float((seen * predicted).sum())
    if 0.0 in sizes:
        return math.inf, 0.0
    return math.copysign(sizes[0] / sizes[1], both), abs(both) / (sizes[0] * sizes[1])


def likely_rate_hz(acc: Vector, gyr: Vector, unit: str) -> float | None:
    """Return the sample rate at which (n, 3) rates in `unit`, or in the only likely one, turn gravity; else None."""
    fastest = float(np.percentile(np.abs(gyr), 99))
    shown = (si for name in SHOWN["gyr"] if fastest * (si := QUANTITIES["gyr"][name]) < FASTEST_RAD_S)
    units = [QUANTITIES["gyr"][unit]] if unit else [*shown]
    likely = []
    for si in units:
        # the second time with the right smoothing
        hz = [ANY_HZ]
        while len(hz) < 3 and (factor := rate_factor(np.arange(len(acc)) / hz[-1], acc, gyr)):
            hz.append(hz[-1] * si / abs(factor))
        if len(hz) == 3 and LIKELY_HZ[0] < hz[2] < LIKELY_HZ[1] and abs(math.log2(hz[2] / hz[1])) < SETTLED_OCTAVES:
            likely.append(float(f"{hz[2]:.3g}"))
    return likely[0] if len(likely) == 1 else None


def are_increments(t: Vector, acc: Vector, gyr: Vector, rate_hz: float) -> bool:
    """Return True if (n, 3) numbers are increments of velocity and angle over a sample, which turn those as gravity."""
    factor = rate_factor(t, acc, gyr)
    return is_gravity(typical_size(acc)[0] * rate_hz) and bool(gyro_unit(factor and factor / rate_hz))


def is_gravity(size_mps2: float) -> bool:
    """Return True if an acceleration is likely to be gravity, where nothing else shows it."""
    return 1 / MOST_LIKELY <= size_mps2 / STANDARD_GRAVITY_MPS2 <= MOST_LIKELY


def gyro_unit(factor: float | None, named: str = "") -> str:
    """Return the unit of rates with this rate_factor, first `named`, the one in the file; empty if there is none."""
    return _first_unit("gyr", named, 1 / abs(factor), 1 / MOST_TURNED, MOST_TURNED) if factor else ""


def resting_gyro_unit(t: Vector, acc: Vector, gyr: Vector) -> str:
    """Return the only usual unit in which (n, 3) rates are those of a sensor that hardly turned gravity; or empty.

    In larger units its rates would turn gravity, or its bias be too large; in smaller ones it would be too quiet.
    """
    quiet = quietest(gyr)
    noise, bias = float(quiet.std(axis=0).max()), float(np.abs(quiet.mean(axis=0)).max())
    fastest = float(np.percentile(np.abs(gyr), 99))
    ratio = abs(turning(t, acc, gyr)[0])
    likely = [
        unit
        for unit, si in QUANTITIES["gyr"].items()
        if unit in ("rad/s", "deg/s")
        and si < MOST_TURNED_MORE * ratio
        and bias * si < math.radians(MPU6050.zero_rate_dps)
        and fastest * si < FASTEST_RAD_S
        and not 0.0 < noise * si < LEAST_NOISE_RAD_S
    ]
    return likely[0] if len(likely) == 1 else ""
