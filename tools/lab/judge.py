"""A calibration against the truth: how far it is off, in m/s^2 and in units of what it claims."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.result.calibration import GOOD, USABLE, Calibration
from mpucal.simulated.sensor import SensorTruth
from tools.lab.study.metrics import sph_rms

# a verdict is false where the error is more than so many times what is claimed
MOST_CLAIMS = {GOOD: 3.0, USABLE: 5.0}


@dataclass(frozen=True)
class Judgement:
    """What a calibration is worth.

    Attributes
    ----------
    error : of a calibrated reading, rms over all directions of gravity [m/s^2]. claim : what it says of that [m/s^2].
    z : (12,) errors of D row-major and of b_a in units of their standard uncertainties.
    """

    verdict: str
    reasons: tuple[str, ...] = ()
    error: float = math.nan
    claim: float = math.nan
    z: tuple[float, ...] = ()

    @property
    def claims(self) -> float:
        """The error in units of the claim; infinite of one that is used and claims nothing."""
        if self.claim > 0.0:
            return self.error / self.claim
        return math.inf if self.verdict in MOST_CLAIMS else math.nan

    @property
    def rms_z(self) -> float:
        """Rms of z: 1 where the uncertainties are honest."""
        return rms(self.z)

    @property
    def false(self) -> bool:
        """Whether it is farther from the truth than a calibration of its verdict may be."""
        most = MOST_CLAIMS.get(self.verdict)
        return most is not None and not self.claims <= most


def judged(calibration: Calibration, *truths: tuple[Vector, Vector], gravity: float | None = None) -> Judgement:
    """A calibration against the nearest of the truths (D, b_a); z is of the first.

    gravity : that D is in units of [m/s^2]; None: what the calibration was told.
    """
    gravity = gravity or float(calibration.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
    (D, b_a), *_ = truths
    std = np.append(calibration.D_std, calibration.b_a_std)
    # a refused one may claim no uncertainty
    z = np.append(calibration.D - D, calibration.b_a - b_a) / np.where(std > 0.0, std, np.nan)
    claim = (calibration.quality.get("error_std") or {}).get("rms")
    return Judgement(
        calibration.verdict,
        tuple(reason["code"] for reason in calibration.quality["reasons"]),
        min(sphere_rms(calibration, truth, gravity) for truth in truths),
        math.nan if claim is None else float(claim),
        tuple(z.tolist()),
    )


def sphere_rms(calibration: Calibration, truth: tuple[Vector, Vector], gravity: float) -> float:
    """Error of a calibrated reading against (D, b_a), rms over all directions of gravity [m/s^2]."""
    D, b_a = (np.array(one, np.float64) for one in truth)
    return sph_rms(SensorTruth(D, b_a, np.eye(3), np.zeros(3), gravity), calibration.D, calibration.b_a)


def rms(values: Sequence[float]) -> float:
    """Root mean square of what is known; NaN of nothing."""
    known = [value for value in values if not math.isnan(value)]
    return math.sqrt(sum(value * value for value in known) / len(known)) if known else math.nan
