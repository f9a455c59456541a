"""What leaves nothing to estimate: wrong units, no rest, no turn, a dead axis. Knows no estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .evidence import Evidence
from .flat_segment import QUIETEST_ACC_MPS2, QUIETEST_GYRO_RAD_S

FEWEST_SAMPLES = 50
LEAST_TURN_RAD = np.deg2rad(20.0)
SLOWEST_HZ = 5.0
LONGEST_TO_LAY_DOWN_S = 10.0
# from this many seconds between samples on, times are rather in microseconds, and in nanoseconds
STEP_OF_MICROSECONDS, STEP_OF_NANOSECONDS = 60.0, 1e5
FASTEST_GYRO_DPS = 4100.0


@dataclass(frozen=True)
class Reason:
    """One thing that speaks against the estimate; `refuse` where nobody should use it."""

    code: str
    message: str
    refuse: bool


Check = Callable[[Evidence], Reason | None]


def no_gyroscope(e: Evidence) -> Reason | None:
    """A recording of the accelerometer alone; nothing else can be said of it."""
    if np.isfinite(e.recording.gyr).all():
        return None
    return Reason(
        "gyro_off",
        "the recording holds the accelerometer alone, as a chip measures at 4000 Hz, and nothing says how the board "
        "was turned; record it at 1000 Hz or less",
        True,
    )


def time_unit(e: Evidence) -> Reason | None:
    """Times that are no seconds."""
    step = 1.0 / e.recording.rate_hz
    if step < 1.0 / SLOWEST_HZ:
        return None
    unit = "nano" if step > STEP_OF_NANOSECONDS else "micro" if step > STEP_OF_MICROSECONDS else "milli"
    return Reason(
        "units_suspect",
        f"the samples are {step:.4g} s apart, too far to follow a turn: their times seem to be in {unit}seconds; "
        "convert them to seconds",
        True,
    )


def accelerometer_unit(e: Evidence) -> Reason | None:
    """Accelerations in g or counts."""
    acc = float(np.median(np.linalg.norm(e.recording.acc, axis=1)))
    if 0.2 * e.gravity < acc < 5.0 * e.gravity:
        return None
    guess = "g" if acc < 5.0 else "mg" if 300.0 < acc < 1700.0 else "raw counts"
    return Reason(
        "units_suspect",
        f"the accelerometer's median magnitude is {acc:.4g}, not near {e.gravity:.4g} m/s^2: it seems to be in "
        f"{guess}; convert it to m/s^2",
        True,
    )


def gyroscope_unit(e: Evidence) -> Reason | None:
    """Rates in deg/s or counts."""
    if time_unit(e) is not None:  # by wrong times no rate fits how gravity turned
        return None
    rate = float(np.quantile(np.abs(e.recording.gyr), 0.99))
    if rate <= np.deg2rad(FASTEST_GYRO_DPS) and not e.turned_in_degrees:
        return None
    guess = "deg/s" if rate <= FASTEST_GYRO_DPS else "raw counts"
    return Reason(
        "units_suspect",
        f"the gyroscope reads up to {rate:.4g}, which as rad/s is {np.rad2deg(rate):.0f} deg/s and does not fit "
        f"how gravity turned: it seems to be in {guess}; convert it to rad/s",
        True,
    )


def never_still(e: Evidence) -> Reason | None:
    """No flat segment, or none before the board was turned."""
    if e.flat is None and e.recording.flat is not None:
        first, last = e.recording.flat
        return Reason(
            "never_still",
            f"the flat segment that was given, samples {first} to {last - 1}, is too short to tell the gyroscope's "
            "bias and the noise; give a second or more of it, or leave it out, and it is looked for",
            True,
        )
    if e.flat is None and e.turned_in_degrees:
        return None
    if e.flat is None:
        return Reason(
            "never_still",
            "the board never lay still for a second, so the gyroscope's bias and the noise are not known; lay it on a "
            "table for ten seconds before you turn it",
            True,
        )
    if not _rested_late(e):
        return None
    return Reason(
        "never_still",
        f"the board lay still only after {_seconds_before(e):.0f} s, when its turns were over; lay it on a table for "
        "ten seconds before you turn it",
        True,
    )


def hardly_turned(e: Evidence) -> Reason | None:
    """A board that was not rotated after it lay flat."""
    if e.flat is None or _rested_late(e):
        return None
    after = len(e.recording) - e.flat.last
    if e.gravity_moved >= LEAST_TURN_RAD and after >= FEWEST_SAMPLES:
        return None
    degrees = np.rad2deg(e.gravity_moved)
    return Reason(
        "few_orientations",
        f"the board was hardly turned (gravity moved {degrees:.0f} deg in all, in {after} samples after it lay flat); "
        "turn it so that each of its sides, edges and corners points down once",
        True,
    )


def _seconds_before(e: Evidence) -> float:
    """s that passed before the flat segment."""
    return 0.0 if e.flat is None else float(e.recording.t[e.flat.first] - e.recording.t[0])


def _rested_late(e: Evidence) -> bool:
    """Whether the turns came before the rest; a board that is laid down at the start moves gravity too, but soon."""
    turned_before = e.gravity_moved_before >= LEAST_TURN_RAD > e.gravity_moved
    return turned_before and _seconds_before(e) >= LONGEST_TO_LAY_DOWN_S


def dead(code: str, sensor: str, name: str, quietest: float) -> Check:
    """An axis that reads the same throughout, though the board was turned."""

    def check(e: Evidence) -> Reason | None:
        if e.flat is None or e.gravity_moved < LEAST_TURN_RAD:
            return None
        values = getattr(e.recording, name)
        if (np.ptp(values[:100], axis=0) >= quietest).all():
            return None
        constant = np.ptp(values, axis=0) < quietest
        noise = np.sqrt(getattr(e.flat, {"acc": "Sigma_a", "gyr": "Sigma_omega"}[name]))
        # without noise on the other axes the data are computed, and this axis was not turned
        if not constant.all() and not (constant.any() and noise.max() > quietest):
            return None
        axes = " and ".join(axis for axis, is_constant in zip("xyz", constant, strict=True) if is_constant)
        return Reason(
            code,
            f"the {sensor} reads the same on {axes} in every sample, though the board was turned: it is broken or was "
            "not recorded; check its wiring and the recording",
            True,
        )

    return check


BLOCKERS: tuple[Check, ...] = (
    time_unit,
    accelerometer_unit,
    gyroscope_unit,
    never_still,
    hardly_turned,
    dead("inconsistent", "accelerometer", "acc", QUIETEST_ACC_MPS2),
    dead("gyro_off", "gyroscope", "gyr", QUIETEST_GYRO_RAD_S),
)
