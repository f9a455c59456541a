"""Checks of a recording that leaves nothing to estimate: wrong units, no rest, no turn, a dead axis."""

from __future__ import annotations

import numpy as np

from ...clocks.stamps import LONGEST_STEP_S, SLOWEST_HZ
from ...data import Vector
from ...origin import Origin
from ...reasons import Reason, reason
from ...rests.flat import QUIETEST_ACC_MPS2, QUIETEST_GYRO_RAD_S
from ...rests.limits import LEAST_TURN_RAD
from ..evidence import CLEARLY, Evidence, once
from ..hypothesis_tests import MOST_STD
from ..masks import stuck_readings
from ..rotation import lengths
from ..scores import FEWEST_SAMPLES

LONGEST_TO_LAY_DOWN_S = 10.0
TYPICAL_HZ = 200.0  # the unit of times is that in which the rate is nearest to this
LEAST_G = 0.5  # magnitude in g below which a recording holds no gravity
# Half of the magnitudes of gravity are within this share of the median, whatever the sensor's errors; of a hand's own
# acceleration, or of noise on three axes, half are within 60 %.
STEADY = 0.2
# Gains, biases, noise and a hand's acceleration make a magnitude vary by more; rounding to two decimals leaves as much.
LEAST_SPREAD = 4e-4
FASTEST_GYRO_DPS, SELDOM = 4100.0, 0.01


def no_gyroscope(e: Evidence) -> Reason | None:
    """Find a recording of the accelerometer alone; no other check of it means anything."""
    return None if np.isfinite(e.recording.gyr).all() else reason("gyro_off", "missing")


def time_unit(e: Evidence) -> Reason | None:
    """Find times that are not in seconds, or samples that are too far apart."""
    step = 1.0 / e.recording.rate_hz
    if step < 1.0 / SLOWEST_HZ:
        return None
    if step < LONGEST_STEP_S:
        # A vehicle's messages carry their unit.
        of_vehicle = e.recording.sensor.origin is Origin.VEHICLE
        return reason("units_suspect", "slow_stream" if of_vehicle else "slow", step=step, rate=1.0 / step)
    unit = ("milli", "micro", "nano")[int(np.clip(np.rint(np.log10(TYPICAL_HZ * step) / 3.0), 1, 3)) - 1]
    said = {"milli": "ms", "micro": "us", "nano": "ns"}[unit]
    return reason("units_suspect", "times", step=step, unit=unit, said=said)


def accelerometer_unit(e: Evidence) -> Reason | None:
    """Find accelerations in g or counts."""
    acc = e.median_mps2
    if 0.2 * e.gravity < acc < 5.0 * e.gravity:
        return None
    if acc < LEAST_G:
        rate = float(np.median(lengths(e.recording.gyr)))
        if 0.9 * e.gravity < rate < 1.1 * e.gravity:
            return reason("not_raw", "exchanged", magnitude=acc, rate=rate)
        low, high = np.quantile(e.magnitude, (0.25, 0.75))
        if acc == 0.0 or high - low > STEADY * acc:
            return reason("not_raw", "no_gravity", magnitude=acc)
        unit, said = f"a unit about {e.gravity / acc:.4g} times as large", "UNIT"
        return reason("units_suspect", "accelerometer", magnitude=acc, gravity=e.gravity, unit=unit, said=said)
    if 0.9 * e.gravity < acc / e.gravity < 1.1 * e.gravity:
        unit, said = "m/s^2, and to have been converted from g nevertheless", "m/s^2"
        return reason("units_suspect", "accelerometer", magnitude=acc, gravity=e.gravity, unit=unit, said=said)
    guess = "g" if acc < 5.0 else "mg" if 300.0 < acc < 1700.0 else "raw counts"
    return reason(
        "units_suspect", "accelerometer", magnitude=acc, gravity=e.gravity, unit=guess, said=guess.removeprefix("raw ")
    )


def same_magnitude(e: Evidence) -> Reason | None:
    """Find accelerations whose magnitude is the same in every orientation: somebody has normalised them."""
    size = e.magnitude
    if e.gravity_moved < LEAST_TURN_RAD or np.std(size) > LEAST_SPREAD * np.mean(size):
        return None
    degrees = np.rad2deg(e.gravity_moved)
    return reason("not_raw", "same_magnitude", spread=np.std(size), magnitude=np.mean(size), degrees=degrees)


def two_sensors(e: Evidence) -> Reason | None:
    """Find readings of two sensors that take turns: every other one differs by the same amount all along the rest.

    In no other rest before a gap does it differ the other way, as by a vibration of nearly half the sample rate.
    """
    apart = _apart(e, e.flat_segment.first, e.flat_segment.last)
    for first, last in e.rests.tolist() if apart.any() else ():
        if not e.recording.gap[e.flat_segment.last : first].any():  # across it, the other sensor's turn may be next
            apart[apart * _apart(e, first, last) < 0.0] = 0.0
    if not apart.any():
        return None
    apart = np.abs(apart)
    return reason("not_raw", "two_sensors", apart=apart[:3].max(), rates=np.rad2deg(np.nan_to_num(apart[3:]).max()))


def _apart(e: Evidence, first: int, last: int) -> Vector:
    """Return (6,) m/s^2 and rad/s, by how much every other sample of a rest differs; 0 where not along all of it."""
    readings = np.hstack([e.recording.acc[first:last], e.recording.gyr[first:last]])
    size = len(readings) // (2 * FEWEST_SAMPLES)
    if not size:
        return np.zeros(6)
    pairs = readings[: 2 * FEWEST_SAMPLES * size].reshape(FEWEST_SAMPLES, size, 2, 6)
    differences = np.diff(pairs, axis=2)[:, :, 0].mean(axis=1)
    apart = differences.mean(axis=0) * (-1.0) ** first
    return np.where(np.abs(apart) > MOST_STD * differences.std(axis=0), apart, 0.0)


def gyroscope_unit(e: Evidence) -> Reason | None:
    """Find rates in deg/s or counts."""
    # With wrong times, or without gravity, no rate explains how gravity turned.
    if time_unit(e) is not None or e.median_mps2 < LEAST_G:
        return None
    rates = np.abs(e.recording.gyr)
    if np.mean(rates > np.deg2rad(FASTEST_GYRO_DPS)) <= SELDOM and not e.rates_in_degrees:
        return None
    rate = float(np.quantile(rates, 1.0 - SELDOM))
    guess = "deg/s" if rate <= FASTEST_GYRO_DPS else "raw counts"
    return reason(
        "units_suspect", "gyroscope", rate=rate, degrees=np.rad2deg(rate), unit=guess, said=guess.removeprefix("raw ")
    )


def never_still(e: Evidence) -> Reason | None:
    """Find a recording without a flat segment, or with none before the board was turned."""
    if e.flat is not None:
        return reason("never_still", "late", seconds=_seconds_before(e)) if _rested_late(e) else None
    if e.recording.flat is not None:
        first, last = e.recording.flat
        return reason("never_still", "short", first=first, last=last - 1)
    return None if e.rates_in_degrees else reason("never_still", "at_all")


def hardly_turned(e: Evidence) -> Reason | None:
    """Find a board that was not turned after it lay flat, or whose gravity does not follow it."""
    after = len(e.recording) - e.flat_segment.last
    if _rested_late(e):
        return None
    if e.gravity_moved >= LEAST_TURN_RAD and after >= FEWEST_SAMPLES:
        return None
    if e.gravity_carried > CLEARLY * max(e.gravity_moved, LEAST_TURN_RAD):
        moved, carried = np.rad2deg([e.gravity_moved, e.gravity_carried])
        return reason("not_raw", "stays", degrees=moved, carried=carried)
    return reason("few_orientations", "hardly_turned", degrees=np.rad2deg(e.gravity_moved), samples=after)


def _seconds_before(e: Evidence) -> float:
    """Return the time [s] before the flat segment."""
    return float(e.recording.t[e.flat_segment.first] - e.recording.t[0])


def _rested_late(e: Evidence) -> bool:
    """Return True if the turns came before the rest; a board that is laid down moves gravity too, but soon."""
    turned_before = e.gravity_moved_before >= LEAST_TURN_RAD > e.gravity_moved
    return turned_before and _seconds_before(e) >= LONGEST_TO_LAY_DOWN_S


@once
def dead_accelerometer(e: Evidence) -> Reason | None:
    """Find an axis of the accelerometer that is constant, throughout or for seconds while the others show a turn."""
    axes = _constant_axes(e, e.recording.acc, e.flat_segment.Sigma_a, QUIETEST_ACC_MPS2)
    if axes:
        return reason("bits_stuck", "constant", axes=axes)
    if np.sqrt(e.flat_segment.Sigma_a).max() <= QUIETEST_ACC_MPS2 or not (stuck := stuck_readings(e.recording, "acc")):
        return None  # data that are computed repeat
    (axis, first, last), t = stuck[0], e.recording.t - e.recording.t[0]
    return reason("bits_stuck", "frozen", axis="xyz"[axis], begin=float(t[first - 1]), end=float(t[last - 2]))


@once
def dead_gyroscope(e: Evidence) -> Reason | None:
    """Find an axis of the gyroscope that is constant throughout."""
    axes = _constant_axes(e, e.recording.gyr, e.flat_segment.Sigma_omega, QUIETEST_GYRO_RAD_S)
    return reason("gyro_off", "constant", axes=axes) if axes else None


def _constant_axes(e: Evidence, values: Vector, variance: Vector, quietest: float) -> str:
    """Return the axes of `values` (n, 3) that are constant though the board was turned; empty where none is."""
    if e.gravity_moved < LEAST_TURN_RAD or (np.ptp(values[:100], axis=0) >= quietest).all():
        return ""
    constant = np.ptp(values, axis=0) < quietest
    # Data without noise on the other axes are computed, and this axis was not turned.
    if not constant.all() and np.sqrt(variance).max() <= quietest:
        return ""
    return " and ".join(axis for axis, is_constant in zip("xyz", constant, strict=True) if is_constant)
