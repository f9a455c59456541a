"""Errors of sampling, which are no white noise: coarse steps of a stream, and turns too fast for the sample rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Vector
from ..rests.flat import Flat, rounding
from .problem import Series

STAYS_S = 0.1  # a reading that stays on its step for so long has too little noise to leave it


def with_sampling_errors(series: Series, recording: Recording, flat: Flat) -> Series:
    """Return the series of a stream with more noise where samples are rounded, or too far apart for the board's turn.

    A mean rate by the trapezoidal rule lacks a twelfth of the rates' second difference. A chip is read often enough: in
    a hand's smooth turn the differences cancel.
    """
    acc, gyr, before = recording.acc[flat.last :], recording.gyr[flat.last :], recording.gyr[flat.last - 1 :]
    fewest = max(STAYS_S * recording.rate_hz, 2.0)
    acc_step, gyr_step = recording.sensor.steps
    if acc_step:
        r_scale = _rounding_factor(acc, acc_step, flat.Sigma_a, fewest)
        series = replace(series, r_scale=r_scale if series.r_scale is None else np.maximum(series.r_scale, r_scale))
    if not gyr_step:
        return series
    series = replace(series, q_scale=_rounding_factor(gyr, gyr_step, flat.Sigma_omega, fewest))
    bends = np.pad(np.sum(np.diff(before, n=2, axis=0) ** 2, axis=1), 1)
    lacking = np.maximum(bends[:-1], bends[1:]) / 144.0
    visible = (lacking > flat.Sigma_omega.sum()) & ~recording.gap[flat.last :]
    if visible.any():
        q_extra = np.where(visible, lacking * series.dt**2, 0.0)
        series = replace(series, q_extra=q_extra if series.q_extra is None else series.q_extra + q_extra)
    return series


def _rounding_factor(values: Vector, step: float, variance: Vector, fewest: float) -> Vector:
    """Return the factor (n,) by which rounding makes the noise larger than its variance (3,).

    While a reading stays on its step, its error stays, too, and is the same whenever it comes to stay there again: m
    samples are worth one, and as white noise have m times its variance.
    """
    together = np.stack([_together(axis, fewest) for axis in np.floor(values / step + 1e-6).T], axis=1)
    return np.asarray(np.maximum(1.0, np.mean(together * rounding(values, step) / variance, axis=1)))


def _together(steps: Vector, fewest: float) -> NDArray[np.intp]:
    """Return the number (n,) of samples that have a sample's error in common."""
    starts = np.flatnonzero(np.concatenate([[True], steps[1:] != steps[:-1]]))
    lengths = np.diff(np.append(starts, len(steps)))
    _, which = np.unique(steps[starts], return_inverse=True)
    stays = lengths >= fewest
    staying = np.bincount(which, weights=np.where(stays, lengths, 0)).astype(np.intp)
    return np.repeat(np.where(stays, staying[which], lengths), lengths)
