"""The two halves of a recording, cut in the middle of a rest."""

from dataclasses import replace

import numpy as np

from mpucal.data import Recording
from mpucal.result.calibration import Calibration

from .rivals import SHORTEST_S, Rests, Unfit


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """Return both halves of a recording, each of which begins at rest.

    The cut is in the middle of the rest nearest to the middle. Where the board rests only at the start and at the end,
    the cut is in the middle, and the second half is read backwards: gravity and accelerations are the same then, rates
    are reversed.

    Raises
    ------
    Unfit : the board does not rest at the start, or, if it has to, at the end.
    """
    rests = Rests.of(recording)
    recording, flat, runs = rests.recording, (rests.flat.first, rests.flat.last), rests.runs
    n, middle = len(recording), (flat[1] + len(recording)) // 2
    inner = runs[(runs[:, 0] > flat[1]) & (np.abs(runs.mean(1) - middle) < 0.25 * n)]
    if len(inner):
        first, last = min(inner.tolist(), key=lambda run: abs(sum(run) // 2 - middle))
        cut = (first + last) // 2
        return replace(recording.part(0, cut), flat=flat), replace(recording.part(cut, n), flat=(0, last - cut))
    # a rest that began before the cut is cut, too
    first, last = np.maximum(runs[-1], middle).tolist() if len(runs) else (n, n)
    if last < 0.9 * n or last - first < SHORTEST_S * recording.rate_hz:
        raise Unfit("no second rest")
    backwards = reversed_in_time(recording.part(middle, n))
    return replace(recording.part(0, middle), flat=flat), replace(backwards, flat=(n - last, n - first))


def reversed_in_time(recording: Recording) -> Recording:
    """Return the recording of the same motion backwards in time."""
    return replace(
        recording,
        t=recording.t[-1] - recording.t[::-1],
        acc=recording.acc[::-1].copy(),
        gyr=-recording.gyr[::-1],
        temperature_c=recording.temperature_c[::-1].copy(),
        # samples missing before one are missing after it, backwards
        gap=np.append(False, recording.gap[:0:-1]),
        acc_clipped=recording.acc_clipped[::-1].copy(),
        gyr_clipped=recording.gyr_clipped[::-1].copy(),
        flat=None,
    )


def agreement(one: Calibration, other: Calibration) -> tuple[float, ...]:
    """Return (12,) the differences of two calibrations, D row-major and b_a, in units of what both claim."""
    std = np.hypot(np.append(one.D_std, one.b_a_std), np.append(other.D_std, other.b_a_std))
    return tuple((np.append(one.D - other.D, one.b_a - other.b_a) / std).tolist())
