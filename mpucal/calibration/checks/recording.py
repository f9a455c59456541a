"""Checks of the recording alone: the board moved, samples are clipped or lost, the temperature changed, gravity."""

from __future__ import annotations

import numpy as np

from ...arguments import LEAST_ON_EARTH_MPS2, MOST_ON_EARTH_MPS2
from ...data import Mask, Vector
from ...origin import Origin
from ...reasons import Reason, reason
from ...rests.limits import NOISIEST_ACC_MPS2, TIMES_NOISE, VIBRATING_MPS2
from ...rests.windows import noise_variance
from ..evidence import Evidence, once
from ..masks import Stuck, stuck_readings

MOST_RANGE_C = 5.0
MOST_SPOILT = 0.2
# A longer gap is an interruption of the session, which says nothing about the link.
INTERRUPTED_S = 10.0
# The accelerometer's noise is vibration where it exceeds VIBRATING_MPS2 and TIMES_NOISE that of the flat segment for
# MOST_SPOILT of the time, or where it is at rest more than that of any sensor. Below this rate, fourth differences do
# not separate a tremor of up to 12 Hz from noise: only what is larger than the noise of any sensor is vibration.
SEPARABLE_HZ = 60.0


def moved_while_still(e: Evidence) -> Reason | None:
    """Find a board that moved in the flat segment that the caller named."""
    half = e.flat_segment.n // 2
    if half < 2:
        return None
    acc = e.recording.acc[e.flat_segment.first : e.flat_segment.first + 2 * half].reshape(2, half, 3)
    moved = np.abs(acc[1].mean(0) - acc[0].mean(0))
    if (moved <= 0.1 + 6.0 * np.sqrt(2.0 * acc.var(1).min(0) / half)).all():
        return None
    axis = int(np.argmax(moved))
    return reason("moved_while_still", "mean", axis="xyz"[axis], moved=moved[axis])


def clipped(code: str, mask: str, e: Evidence) -> Reason | None:
    """Find samples at the end of a sensor's range, which a mask of the recording marks."""
    marked: Mask = getattr(e.recording, mask)
    share = float(marked.mean())
    return reason(code, "samples", share > MOST_SPOILT, count=int(marked.sum()), share=share) if share else None


def data_lost(e: Evidence) -> Reason | None:
    """Find gaps that nothing else explains; more than half of the time lost refuses, long gaps not counted."""
    gaps, t = _unexplained_gaps(e), e.recording.t
    if not gaps.any():
        return None
    places = int(np.count_nonzero(gaps & ~np.append(False, gaps[:-1])))
    missing = np.diff(t, prepend=t[0])[gaps]
    lost = float(missing.sum())
    interrupted = float(missing[missing > INTERRUPTED_S].sum())
    return reason(
        "data_lost",
        {Origin.VEHICLE: "link", Origin.FILE: "file"}.get(e.recording.sensor.origin, "bus"),
        2.0 * (lost - interrupted) > float(t[-1] - t[0] - interrupted),
        places=f"{places} place{'s' if places > 1 else ''}",
        seconds=lost,
    )


def gyroscope_frozen(e: Evidence) -> Reason | None:
    """Find an axis of the gyroscope that froze; for more than half of the time refuses."""
    runs, t = _frozen_rates(e), e.recording.t - e.recording.t[0]
    if not runs:
        return None
    longest, frozen = max(runs, key=lambda run: run.last - run.first), np.zeros(len(t), bool)
    for run in runs:
        frozen[run.first : run.last] = True
    repeats = np.ptp(e.recording.gyr[longest.first - 1 : longest.last - 1], axis=0) == 0.0
    return reason(
        "bits_stuck",
        "rate",
        2.0 * float(np.diff(t, prepend=0.0)[frozen].sum()) > float(t[-1]),
        axes=" and ".join(axis for axis, one in zip("xyz", repeats, strict=True) if one),
        begin=float(t[longest.first - 1]),
        end=float(t[longest.last - 2]),
    )


@once
def _frozen_rates(e: Evidence) -> list[Stuck]:
    """Return where rates repeat while the accelerometer goes on; otherwise whole samples repeat, and are lost."""
    return [run for run in stuck_readings(e.recording, "gyr") if _moves(e.recording.acc[run.first - 1 : run.last - 1])]


def _moves(acc: Vector) -> bool:
    """Return True if most readings (n, 3) differ from the one before."""
    return bool(np.any(np.diff(acc, axis=0), axis=1).mean() > 0.5)


def _unexplained_gaps(e: Evidence) -> Mask:
    """Return the gaps (n,) without frozen rates, and without the first one that ends after each known interruption."""
    recording = e.recording
    gaps, t = recording.gap.copy(), recording.t
    for run in _frozen_rates(e):
        gaps[run.first : run.last] = False
    at = np.flatnonzero(gaps)
    within = [t_s for t_s in recording.interrupted if t_s >= t[0]]
    after = np.searchsorted(t[at], within, side="right")
    gaps[at[after[after < len(at)]]] = False
    return gaps


def vibrating(e: Evidence) -> Reason | None:
    """Find vibration, as of a motor that runs from the start or from later on."""
    std = np.sqrt(noise_variance(e.recording) @ np.full(3, 1.0 / 3.0))
    least = NOISIEST_ACC_MPS2 if e.recording.rate_hz < SEPARABLE_HZ else VIBRATING_MPS2
    share = float(np.mean(std > np.maximum(least, TIMES_NOISE * np.sqrt(e.flat_segment.Sigma_a.mean()))))
    at_rest = float(np.median(std[e.flat_segment.first : e.flat_segment.last]))
    if share < MOST_SPOILT and at_rest < NOISIEST_ACC_MPS2:
        return None
    return reason(
        "vibrating",
        "noise",
        std=float(np.median(std[e.flat_segment.last :])),
        share=max(share, float(at_rest > NOISIEST_ACC_MPS2)),
    )


def temperature_moved(e: Evidence) -> Reason | None:
    """Find a sensor that warmed or cooled while it was measured."""
    known = e.recording.temperature_c[np.isfinite(e.recording.temperature_c)]
    if len(known) < 10:
        return None
    low, high = np.quantile(known, [0.02, 0.98])
    if high - low <= MOST_RANGE_C:
        return None
    of_vehicle = e.recording.sensor.origin is Origin.VEHICLE
    return reason("temperature_moved", "of_vehicle" if of_vehicle else "range", low=low, high=high)


def gravity_unlikely(e: Evidence) -> Reason | None:
    """Find a gravity outside the range found on Earth that the caller did not confirm."""
    least, most = LEAST_ON_EARTH_MPS2, MOST_ON_EARTH_MPS2
    if e.gravity_anyway or least <= e.gravity <= most:
        return None
    return reason("gravity_unlikely", "beyond_earth", gravity=e.gravity, least=least, most=most)
