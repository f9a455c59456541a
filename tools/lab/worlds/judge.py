"""Which verdicts are false: what a calibration claims beside how far it is from the truth.

An error is the rms over the whole sphere of a calibrated vector's error [m/s^2]; the claim is quality.error_std.rms; z
is their ratio. A `good` verdict is false where z is above 3 or the error above 0.1 m/s^2, a `usable` one where z is
above 5.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import mpucal
from mpucal.errors import MpucalError
from mpucal.result.calibration import GOOD, REFUSED, USABLE
from tools.lab.study.metrics import sph_rms

from .family import GRAVITY_MPS2, Family, Wanted, simulate

GOOD_Z, GOOD_MPS2, USABLE_Z = 3.0, 0.1, 5.0
CRASHED = "crashed"
# who is told of an unlikely gravity knows that all gains are in units of it, and the truth is compared so
GRAVITY_NAMED = "gravity_unlikely"
# limits over all families, and over one of those whose recordings nothing is wrong with
FALSE_SHARE, GOOD_SHARE, SHARP_MPS2 = 0.003, 0.98, 1e-3
# of a family's rms z: below, its claims are too wide, and above, too narrow
RMS_Z = (0.5, 1.5)


@dataclass(frozen=True)
class Run:
    """The verdict on the recording of a seed; error and claim in m/s^2, NaN where there is none."""

    family: str
    seed: int
    verdict: str
    reasons: tuple[str, ...] = ()
    error: float = math.nan
    claim: float = math.nan
    model: str = ""
    seconds: float = 0.0
    why: str = ""

    @property
    def z(self) -> float:
        """Error over claim; infinite of a verdict other than refused that claims nothing."""
        if math.isfinite(self.claim) and self.claim > 0.0:
            return self.error / self.claim
        return math.nan if self.verdict in (REFUSED, CRASHED) else math.inf

    @property
    def false(self) -> bool:
        """Whether the verdict is."""
        if self.verdict == GOOD:
            return not (self.z <= GOOD_Z and self.error <= GOOD_MPS2)
        return self.verdict == USABLE and not self.z <= USABLE_Z


def judged(family: Family, seed: int, model: str = "auto") -> Run:
    """Simulate, calibrate and compare."""
    simulated = simulate(family, seed)
    gravity = family.told_gravity or GRAVITY_MPS2
    began = time.perf_counter()
    try:
        result = mpucal.calibrate(simulated.recording, model=model, gravity=gravity)
    except MpucalError as error:
        return Run(family.name, seed, REFUSED, (type(error).__name__,), why=str(error))
    except Exception as error:  # whatever it is, the other runs go on, and the exit code is 1
        return Run(family.name, seed, CRASHED, (type(error).__name__,), why=repr(error))
    claim = result.quality["error_std"]["rms"]
    reasons = result.quality["reasons"]
    codes, truth = tuple(reason["code"] for reason in reasons), simulated.truth
    if GRAVITY_NAMED in codes and result.verdict != GOOD:
        truth = replace(truth, D=truth.D * (truth.gravity / gravity), gravity=gravity)
    return Run(
        family.name,
        seed,
        result.verdict,
        codes,
        sph_rms(truth, result.D, result.b_a),
        math.nan if claim is None else float(claim),
        str(result.fit["model"]),
        time.perf_counter() - began,
        "; ".join(str(reason["message"]) for reason in reasons),
    )


@dataclass(frozen=True)
class Count:
    """The runs of a family, or of all, in numbers; errors and claims are medians [m/s^2] of those not refused."""

    runs: int
    good: int
    usable: int
    refused: int
    crashed: int
    false_good: int
    false_usable: int
    rms_z: float
    max_z: float
    error: float
    claim: float
    worst_good: float
    reasons: dict[str, int]


def count(runs: Sequence[Run]) -> Count:
    """What the runs amount to."""
    verdicts = Counter(run.verdict for run in runs)
    told = [run for run in runs if run.verdict in (GOOD, USABLE)]
    z = np.array([run.z for run in told] or [math.nan])
    false = Counter(run.verdict for run in told if run.false)
    return Count(
        len(runs),
        verdicts[GOOD],
        verdicts[USABLE],
        verdicts[REFUSED],
        verdicts[CRASHED],
        false[GOOD],
        false[USABLE],
        float(np.sqrt(np.mean(z * z))),
        float(z.max()),
        float(np.median([run.error for run in told] or [math.nan])),
        float(np.median([run.claim for run in told] or [math.nan])),
        max((run.error for run in told if run.verdict == GOOD), default=math.nan),
        dict(Counter(code for run in runs for code in run.reasons).most_common()),
    )


def broken(families: Sequence[Family], runs: Sequence[Run]) -> list[str]:
    """The limits that the runs break, a sentence each."""
    total, found = count(runs), []
    if total.false_good > FALSE_SHARE * total.good:
        found.append(f"{total.false_good} of {total.good} good verdicts are false, more than {100 * FALSE_SHARE:g} %")
    if total.worst_good > GOOD_MPS2:
        found.append(f"a good one is off by {total.worst_good:.3g} m/s², more than {GOOD_MPS2:g}")
    if total.false_usable:
        found.append(f"{total.false_usable} of {total.usable} usable verdicts are false")
    if total.crashed:
        found.append(f"{total.crashed} calibrations crashed")
    for family in families:
        of = count([run for run in runs if run.family == family.name])
        if family.wanted is not Wanted.HONEST and of.good < GOOD_SHARE * of.runs:
            found.append(f"{family.name}: {of.good} of {of.runs} are good, less than {100 * GOOD_SHARE:g} %")
        if family.wanted is Wanted.SHARP and not of.error <= SHARP_MPS2:
            found.append(f"{family.name}: median error {of.error:.2g} m/s², more than {SHARP_MPS2:g}")
    return found


def beside(families: Sequence[Family], runs: Sequence[Run]) -> dict[str, float]:
    """The rms z by name of those families in which it lies outside RMS_Z."""
    z = {family.name: count([run for run in runs if run.family == family.name]).rms_z for family in families}
    return {name: rms for name, rms in z.items() if not RMS_Z[0] <= rms <= RMS_Z[1] and not math.isnan(rms)}
