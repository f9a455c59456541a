"""Calibrations of one sensor at different temperatures, merged into one with b_a(T) if the data support it.

    b_a,k = b_a + slope (T_k - T_0) + e_k,    e_k with the standard deviation of calibration k,

is a straight line for each axis, by weighted least squares. T_0 is the weighted mean of the T_k, at which the errors of
b_a and slope are independent. D is the weighted mean: if D changes with temperature too, half of its change remains as
an error at the lowest and highest temperature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data import Vector
from ..errors import RefusedError, UsageError
from ..reasons import reason
from .calibration import GOOD, REFUSED, Calibration
from .comparison import compare, in_body_frame
from .correlation import UNCORRELATED

# Over a smaller span of temperatures the drift of a day looks like a slope, and a thermometer errs by a degree.
LEAST_SPAN_C = 5.0
# In standard deviations: a smaller slope is not significant, and a point farther from the line contradicts it.
LEAST_SLOPE_STD, MOST_LINE_STD = 3.0, 4.0
DIGEST = "recording_digest"


@dataclass(frozen=True)
class MergeResult:
    """Result of a merge.

    Attributes
    ----------
    calibration : the merged one. why : a sentence on whether it has b_a(T), and the reason.
    remarks : further sentences for the user.
    """

    calibration: Calibration
    why: str
    remarks: tuple[str, ...]


def merge(calibrations: Sequence[Calibration]) -> MergeResult:
    """Merge calibrations into one, with b_a(T) if their temperatures and uncertainties support it.

    Raises
    ------
    UsageError : there are fewer than two, their sensors differ, or a temperature or uncertainty is not known.
    RefusedError : one of them was refused, or several were made from the same recording.
    """
    _check(calibrations)
    all_ = [in_body_frame(c) for c in calibrations]
    T = np.array([c.sensor.temperature_c for c in all_], float)
    b_a, weight = np.array([c.b_a for c in all_]), np.array([c.b_a_std for c in all_]) ** -2.0
    # One T_0 for the three axes, as the blob has only one.
    T_0 = float((weight.sum(1) * T).sum() / weight.sum())
    constant = (weight * b_a).sum(0) / weight.sum(0)
    line, line_std, slope, slope_std = _line(T - T_0, b_a, weight)
    worst_constant = _worst(b_a - constant, weight)
    worst_line = _worst(b_a - line - np.outer(T - T_0, slope), weight)
    steepness = float(np.abs(slope / slope_std).max()) if np.ptp(T) >= LEAST_SPAN_C else 0.0
    why = _objection(T, steepness, worst_line, worst_constant, len(all_))
    base = _weighted_mean(all_, T_0, T)
    if why is not None:
        merged = replace(base, b_a=constant, b_a_std=weight.sum(0) ** -0.5)
        return MergeResult(merged, f"The data do not support b_a(T): {why}", _remarks(all_))
    merged = replace(
        base,
        b_a=line,
        b_a_std=line_std,
        b_a_slope=slope,
        b_a_slope_std=slope_std,
        temperature_range_c=np.array([T.min(), T.max()]),
    )
    why = (
        f"b_a(T) is a line from {T.min():.1f} to {T.max():.1f} °C with a slope of up to {steepness:.0f} standard"
        f" deviations; the calibrations lie within {worst_line:.1f} of it."
    )
    if len(all_) == 2:
        why += " Two points always lie on a line: calibrate at a third temperature to confirm it."
    return MergeResult(merged, why, _remarks(all_))


def _check(calibrations: Sequence[Calibration]) -> None:
    if len(calibrations) < 2:
        raise UsageError("only one calibration was given", "give two or more from different temperatures")
    if any(c.quality.get("verdict") == REFUSED for c in calibrations):
        raise RefusedError("one of the calibrations was refused", "repeat its session as its reasons say")
    _check_recordings(calibrations)
    if any(c.sensor.temperature_c is None or not _is_sure(c) for c in calibrations):
        raise UsageError(
            "one of the calibrations lacks its temperature or its uncertainties",
            "give a calibration.json of a chip's session, not its blob",
        )
    if any(c.follows_temperature for c in calibrations):
        raise UsageError("one of the calibrations is merged already", "give the calibrations that it was made from")
    if any("autopilot" in c.extra for c in calibrations):
        raise UsageError(
            "one of the calibrations is of an autopilot's stream, and the autopilot's parameters may have changed",
            "use the autopilot's own temperature calibration, or a chip's session",
        )
    of = [
        (c.sensor.who_am_i, c.sensor.accel_offsets, c.fit.get("gravity"), *c.applied_in_hardware) for c in calibrations
    ]
    chips, offsets, gravities, *applied = (set(values) for values in zip(*of, strict=True))
    if len(chips - {None}) > 1 or len(offsets - {None}) > 1:
        raise UsageError("the calibrations are of different sensors", "give those of one sensor")
    if len(gravities) > 1:
        raise UsageError(
            "the calibrations were made with different gravities", "calibrate again with the same --gravity"
        )
    if any(len(values) > 1 for values in applied):
        raise UsageError(
            "the offset registers subtract different values in the calibrations", "give those made before a write"
        )


def _check_recordings(calibrations: Sequence[Calibration]) -> None:
    """Raise RefusedError if several calibrations are from the same recording."""
    of = [_recordings(c) for c in calibrations]
    for i, one in enumerate(of):
        same = [i, *(k for k in range(i + 1, len(of)) if of[k] & one)]
        if len(same) > 1:
            against = reason("same_data", "merged", numbers=" and ".join(str(k + 1) for k in same))
            raise RefusedError(against.what, against.remedy)


def _recordings(c: Calibration) -> frozenset[str]:
    """Return the digests of a calibration's recordings; without a digest, its numbers identify its recording."""
    parts: Sequence[Mapping[str, Any]] = c.extra.get("merged") or [c.fit]
    digests = [str(part.get(DIGEST) or "") for part in parts]
    return frozenset(digests if all(digests) else [f"{c.D.tolist()} {c.b_a.tolist()}"])


def _is_sure(c: Calibration) -> bool:
    known = all(np.isfinite(values).all() for values in (c.D, c.b_a, c.D_std, c.b_a_std))
    return bool(known and c.b_a_std.all() and c.D_std.all())


def _line(away: Vector, b_a: Vector, weight: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Fit b_a = b_a_0 + slope `away` by weighted least squares; return b_a_0 (3,), its std, slope (3,) and its std.

    away : (k,) C, T - T_0. If all are equal, the slope is 0 and its standard deviation infinite.
    """
    x = away[:, None]
    w, wx, wxx = (np.sum(weight * x**power, axis=0) for power in range(3))
    wy, wxy = (np.sum(weight * b_a * x**power, axis=0) for power in range(2))
    determinant = w * wxx - wx**2
    if np.ptp(away) == 0.0:
        return wy / w, w**-0.5, np.zeros(3), np.full(3, np.inf)
    b_a_0, slope = (wxx * wy - wx * wxy) / determinant, (w * wxy - wx * wy) / determinant
    return b_a_0, np.sqrt(wxx / determinant), slope, np.sqrt(w / determinant)


def _worst(residual: Vector, weight: Vector) -> float:
    """Return the largest residual, in standard deviations."""
    return float(np.abs(residual * np.sqrt(weight)).max())


def _objection(T: Vector, steepness: float, worst_line: float, worst_constant: float, count: int) -> str | None:
    """Return the reason against b_a(T), as the end of a sentence; None if there is none."""
    if np.ptp(T) < LEAST_SPAN_C:
        return f"their temperatures span {np.ptp(T):.1f} °C, but {LEAST_SPAN_C:g} are needed."
    if worst_line > MOST_LINE_STD and count > 2:
        return (
            f"no line fits them, the worst is {worst_line:.1f} standard deviations off; b_a is their mean, with the"
            f" worst {worst_constant:.1f} off."
        )
    if steepness < LEAST_SLOPE_STD:
        return f"the slope is not significant ({steepness:.1f} standard deviations at most); b_a is their mean."
    return None


def _weighted_mean(all_: Sequence[Calibration], T_0: float, T: Vector) -> Calibration:
    """Return the merged calibration except for its bias: D is a weighted mean, and `extra` lists the calibrations."""
    weight = np.array([c.D_std for c in all_]) ** -2.0
    D = (weight * np.array([c.D for c in all_])).sum(0) / weight.sum(0)
    parts: list[dict[str, Any]] = [
        {"created": c.created, "temperature_c": float(t), "b_a": c.b_a.tolist(), DIGEST: c.fit.get(DIGEST)}
        for c, t in zip(all_, T, strict=True)
    ]
    last = max(all_, key=lambda c: c.created)
    worst = max(all_, key=lambda c: c.verdict != GOOD)
    return replace(
        last,
        D=np.asarray(D),
        D_std=np.asarray(weight.sum(0) ** -0.5),
        K=np.asarray(np.mean([c.K for c in all_], axis=0)),
        correlation=UNCORRELATED,
        quality=worst.quality,
        sensor=replace(last.sensor, temperature_c=T_0),
        extra={"merged": parts},
        doubt=next((c.doubt for c in all_ if c.doubt), ""),
    )


def _remarks(all_: Sequence[Calibration]) -> tuple[str, ...]:
    """Return a remark if D changed significantly."""
    coldest, warmest = (pick(all_, key=lambda c: c.sensor.temperature_c or 0.0) for pick in (min, max))
    changed = [d for d in compare(coldest, warmest).changed if d.unit != "mg"]
    if not changed:
        return ()
    named = ", ".join(f"{d.name} by {d.value:+.3f} {d.unit}" for d in changed[:3])
    return (f"D changed with temperature, too ({named}): half of that remains at the coldest and the warmest.",)
