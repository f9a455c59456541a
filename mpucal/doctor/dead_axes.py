"""Dead axes, whose counts do not change, and stuck bits of the accelerometer's words.

Noise moves the last bits of every live axis of these chips (2 mg and 0.03 deg/s at 44 Hz, where a count is 0.12 mg and
0.015 deg/s), and of the thermometer. A board at rest shows one place of the range, where a stuck bit may do no harm:
the offset registers shift the reading by each power of two, and it is wrong by the value of a stuck bit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..chip import registers as reg
from ..chip.families import Part
from ..chip.offsets import MOTION_G, OffsetRegisters, OffsetResponse, restoring, shift_words
from ..chip.port import Port
from ..chip.quick_measure import AFS_SEL, TemporaryMeasurement
from ..data import Mask, Recording, Vector, mps2_per_count, rad_s_per_count
from ..errors import BoardMoved
from .finding import Finding, Mark

DEAD_AXIS, STUCK_BITS = "dead axis", "stuck bits"
REPLACE = "check its supply and solder joints, and power it up again; if that does not help, replace the chip"
# An axis died midway if it stood still for this time, in which it would have changed so often before.
LONG_S, MANY_CHANGES = 2.0, 50.0

# Lower bits move with the noise, or show as a dead axis; the highest step takes the reading through zero.
STEPS = tuple(range(8, 15))
# A reading may miss by this share of a step, the error of its measured scale, and by this number of counts of noise.
TOLERANCE, NOISE_COUNTS = 0.02, 64.0


def live_axes(recording: Recording) -> tuple[Mask, Mask]:
    """Return masks (3,) of the accelerometer's and the gyroscope's axes: True where an axis measures all the time."""
    hz = recording.rate_hz
    acc, gyr = (
        np.array([_still_part(column, hz) is None and _zero_byte_part(column, lsb, hz) is None for column in values.T])
        for _, values, _, lsb in _sensors(recording)
    )
    return acc, gyr


def dead_axes(recording: Recording) -> Iterator[Finding]:
    """Find the axes that stood still, throughout or from some time on, and those of which only the high byte moves."""
    stood: dict[str, list[str]] = {}
    low_byte: list[str] = []
    for sensor, values, clipped, lsb in _sensors(recording):
        for axis, column in zip("xyz", values.T, strict=True):
            zero_byte, still = _zero_byte_part(column, lsb, recording.rate_hz), _still_part(column, recording.rate_hz)
            if still is None and zero_byte is None:
                continue
            value = float(column[still or zero_byte][0])
            if still is None or (zero_byte is not None and value != 0.0 and not clipped[still].all()):
                low_byte.append(f"{sensor} {axis}")
                continue
            at = "zero" if value == 0 else "the end of its range" if clipped[still].all() else f"{value:.4g}"
            since = recording.t[still.start] - recording.t[0]
            stood.setdefault(at + (f" from {since:.0f} s on" if still.start else ""), []).append(f"{sensor} {axis}")
    celsius = recording.temperature_c
    if np.isfinite(celsius).all() and np.ptp(celsius) == 0:
        stood.setdefault(f"{celsius[0]:.1f} °C", []).append("the thermometer")
    if stood:
        what = "; ".join(f"{', '.join(axes)} stayed at {where}" for where, axes in stood.items())
        data = {"dead": [axis for axes in stood.values() for axis in axes]}
        yield Finding(DEAD_AXIS, Mark.BAD, what, REPLACE, data)
    if low_byte:
        what = f"the low byte of {', '.join(low_byte)} stays 0: all readings are multiples of 256 counts"
        yield Finding(STUCK_BITS, Mark.BAD, what, REPLACE, {"low_byte": low_byte})


def _sensors(recording: Recording) -> Iterator[tuple[str, Vector, Mask, float | None]]:
    """Yield each sensor's name, values, mask of clipped samples, and value of one count, if that is known."""
    accel_g, gyro_dps = recording.sensor.accel_range_g, recording.sensor.gyro_range_dps
    mps2 = None if accel_g is None else mps2_per_count(accel_g)
    rad_s = None if gyro_dps is None else rad_s_per_count(gyro_dps)
    yield "accelerometer", recording.acc, recording.acc_clipped, mps2
    yield "gyroscope", recording.gyr, recording.gyr_clipped, rad_s


def _still_part(column: Vector, rate_hz: float) -> slice | None:
    """Return the part in which an axis (n,) stood still: all of it, or longer than its changes before allow."""
    longest = _longest(np.diff(column) == 0)
    inside = longest.stop - longest.start
    if inside == len(column) - 1:
        return slice(0, len(column))
    changes = np.count_nonzero(np.diff(column)) / (len(column) - 1 - inside)
    surely = inside > LONG_S * rate_hz and inside * changes > MANY_CHANGES
    return slice(longest.start, longest.stop + 1) if surely else None


def _zero_byte_part(column: Vector, lsb: float | None, rate_hz: float) -> slice | None:
    """Return the part in which the low byte of an axis (n,) stays 0 for long."""
    if lsb is None:
        return None
    longest = _longest(np.rint(column / lsb).astype(np.int64) & 0xFF == 0)
    return longest if longest.stop - longest.start > LONG_S * rate_hz else None


def _longest(holds: Mask) -> slice:
    """Return the longest run of True in a mask (n,)."""
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return slice(*edges[np.diff(edges, axis=1).argmax()].tolist()) if len(edges) else slice(0, 0)


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
