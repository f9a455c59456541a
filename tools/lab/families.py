"""Are verdicts true? Simulated hands and sensors of many kinds, calibrated and compared with their truth.

python -m tools.lab families --seeds 0:6
python -m tools.lab families --families 'poses*;continuous' --seeds 0:33 --jobs 2 --json families.json

A family is a row of scenarios/table.py. An error is the rms over the whole sphere of a calibrated vector's error
[m/s^2]; the claim is quality.error_std.rms. A `good` verdict is false where the error is above 3 claims or 0.1 m/s^2, a
`usable` one where it is above 5 claims. Seeds 0 to 32 are for development: limits and constants are set on them. Seeds
4000 to 4032 are for reports, and nothing is set on what they show; tests have 100 and 101. The exit code is 1 where a
limit is broken.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

import mpucal
from mpucal.errors import MpucalError
from mpucal.result.calibration import GOOD, REFUSED, USABLE
from mpucal.result.comparison import degrees_of_freedom, limit_of
from mpucal.result.keys import Model

from .judge import judged, judgement, rms
from .runner import Trial
from .scenarios.family import Wanted, drawn
from .scenarios.sensors import GRAVITY_MPS2
from .scenarios.table import FAMILIES, of_families
from .table import VERDICTS, Column, Row, count, frequencies, grouped, known, over, show, table

GOOD_MPS2 = 0.1
CRASHED = "crashed"
# after the warning of an unlikely gravity, scale factors count in units of it
GRAVITY_NAMED = "gravity_unlikely"
# limits over all families, and for one of the families with sound recordings
FALSE_SHARE, GOOD_SHARE, SHARP_MPS2 = 0.003, 0.98, 1e-3
# limits of the rms of a family's errors in units of its claims: too wide below, too narrow above
RMS_CLAIMS = (0.5, 1.5)


def of_seed(item: tuple[str, int], *, model: Model = "auto") -> Row:
    """Simulate a family's name and a seed, calibrate and compare."""
    name, seed = item
    family = FAMILIES[name]
    simulated, gravity = drawn(family, seed), family.told_gravity or GRAVITY_MPS2
    try:
        result = mpucal.calibrate(simulated.recording, model=model, gravity=gravity)
    except Exception as error:  # after any error the other runs continue, and the exit code is 1
        verdict = REFUSED if isinstance(error, MpucalError) else CRASHED
        return row(judgement(verdict, (type(error).__name__,), family=name, seed=seed, why=repr(error)))
    truth, reasons = simulated.truth, result.quality["reasons"]
    D, unit = truth.D, truth.gravity
    if GRAVITY_NAMED in [reason["code"] for reason in reasons] and result.verdict != GOOD:
        D, unit = D * (unit / gravity), gravity
    # a calibration may be of the part before its mount slipped, or of that after it
    truths = [(D, truth.b_a), *((each.D, each.b_a) for each in simulated.slipped)]
    more = {"model": result.fit["model"], "why": [str(reason["message"]) for reason in reasons]}
    return row(judged(result, *truths, gravity=unit, family=name, seed=seed, **more))


def row(worth: Row) -> Row:
    """Return a judgement; a good verdict is false also if the error alone is large."""
    worth.false |= worth.verdict == GOOD and not worth.error <= GOOD_MPS2
    return worth


def used(runs: Sequence[Row]) -> list[Row]:
    """Return the runs that are not refused."""
    return [run for run in runs if run.verdict in (GOOD, USABLE)]


def false(runs: Sequence[Row], verdict: str) -> int:
    """Return the number of false verdicts of this kind."""
    return sum(run.false and run.verdict == verdict for run in runs)


def of_used(name: str, make: Column) -> Column:
    """Return a column over an attribute of the runs that are not refused."""
    return lambda runs: over(name, make)(used(runs))


def rms_claims(runs: Sequence[Row]) -> float:
    """Return the rms of the errors, in units of the claims, of the runs that are not refused."""
    return rms(known(used(runs), "claims"))


def worst_good(runs: Sequence[Row]) -> float | None:
    """Return the largest error of a good calibration [m/s^2]."""
    return max((run.error for run in runs if run.verdict == GOOD), default=None)


def told_apart(runs: Sequence[Row]) -> float:
    """Return the share of pairs of good calibrations that `mpucal diff` would tell apart, were they of one sensor.

    The difference of two has the errors of both; they are compared as if both claimed as much.
    """
    good = [run for run in runs if run.verdict == GOOD]
    z = np.array([run.z for run in good])
    apart: list[bool] = []
    for i, one in enumerate(good):
        limits = [math.sqrt(2.0) * _limit(len(one.z), one.model, other.model) for other in good[i + 1 :]]
        apart += (np.abs(z[i + 1 :] - z[i]).max(axis=1, initial=0.0) > limits).tolist()
    return float(np.mean(apart)) if apart else math.nan


@cache
def _limit(count: int, *models: str) -> float:
    """Return the limit of |z| of each of so many numbers, of calibrations by these models."""
    return limit_of(count, degrees_of_freedom(*models))


COLUMNS: dict[str, Column] = {
    **VERDICTS,
    CRASHED: lambda runs: count("verdict", CRASHED)(runs) or "",
    "false\ngood": lambda runs: false(runs, GOOD),
    "false\nusable": lambda runs: false(runs, USABLE),
    "rms in\nclaims": rms_claims,
    "most": of_used("claims", max),
    "median\nerror": of_used("error", np.median),
    "median\nclaim": of_used("claim", np.median),
    "worst\ngood": worst_good,
    "reasons": lambda runs: frequencies((code for run in runs for code in run.reasons), 3),
}


def broken(runs: Sequence[Row]) -> list[str]:
    """Return a sentence for each limit that the runs exceed."""
    good, usable, crashed = (count("verdict", verdict)(runs) for verdict in (GOOD, USABLE, CRASHED))
    found = []
    if false(runs, GOOD) > FALSE_SHARE * good:
        found.append(f"{false(runs, GOOD)} of {good} good verdicts are false, more than {100 * FALSE_SHARE:g} %")
    if (worst := worst_good(runs) or 0.0) > GOOD_MPS2:
        found.append(f"a good one is off by {worst:.3g} m/s², more than {GOOD_MPS2:g}")
    if false(runs, USABLE):
        found.append(f"{false(runs, USABLE)} of {usable} usable verdicts are false")
    if crashed:
        found.append(f"{crashed} calibrations crashed")
    for name, of in grouped(runs, "family").items():
        wanted, good, error = FAMILIES[name].wanted, count("verdict", GOOD)(of), COLUMNS["median\nerror"](of)
        if wanted is not Wanted.HONEST and good < GOOD_SHARE * len(of):
            found.append(f"{name}: {good} of {len(of)} are good, less than {100 * GOOD_SHARE:g} %")
        if wanted is Wanted.SHARP and not (error is not None and error <= SHARP_MPS2):
            found.append(f"{name}: median error {error or np.nan:.2g} m/s², more than {SHARP_MPS2:g}")
    return found


def beside(runs: Sequence[Row]) -> dict[str, float]:
    """Return the rms in claims by name of those families in which it lies outside RMS_CLAIMS."""
    claims = {name: rms_claims(of) for name, of in grouped(runs, "family").items()}
    return {name: x for name, x in claims.items() if x < RMS_CLAIMS[0] or x > RMS_CLAIMS[1]}


def report(runs: list[Row]) -> int:
    """Print a line a family, and which limits are broken; return 1 where one is."""
    lines = {(name, FAMILIES[name].wanted.value): of for name, of in grouped(runs, "family").items()}
    title = f"{len(runs)} calibrations; errors in m/s², rms over the sphere"
    show(table({**lines, ("all", ""): runs}, COLUMNS, title))
    odd = ", ".join(f"{name} {value:.2g}" for name, value in beside(runs).items())
    print(f"rms in claims outside {RMS_CLAIMS[0]}..{RMS_CLAIMS[1]}: {odd or 'none'}")
    print(f"pairs of good ones that diff would tell apart: {told_apart(runs):.2%}")
    limits = broken(runs)
    print("\n".join(f"BROKEN {limit}" for limit in limits) or "every limit is kept")
    return int(bool(limits))


main = Trial(__doc__, of_seed, of_families, report=report, seeds="0:6")
