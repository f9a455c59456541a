"""Which of the rests that a verification found are in orientations that the calibration has not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...calibration.evidence import Evidence
from ...calibration.verification import NewOrientation
from ...data import Vector
from ...rests.intervals import RestFinder

# shorter than this nobody holds a board still
SHORTEST_REST_S = 0.5


def unseen(rests: Sequence[NewOrientation], evidence: Evidence, apart_rad: float) -> list[NewOrientation]:
    """Those that are `apart_rad` or more from every rest that the fit has seen, and from each other."""
    known, found = directions_seen(evidence), []
    for rest in rests:
        if not len(known) or float((known @ rest.down).max()) <= math.cos(apart_rad):
            known = np.vstack([known, rest.down])
            found.append(rest)
    return found


def directions_seen(evidence: Evidence) -> Vector:
    """(k, 3) unit vectors, calibrated: what pointed down in each rest of the fitted recording."""
    r, fit, flat = evidence.recording, evidence.fit, evidence.flat
    if fit is None or flat is None:
        return np.zeros((0, 3))
    shortest = SHORTEST_REST_S * r.rate_hz
    means = [r.acc[a:b].mean(0) for a, b in RestFinder(r, flat).alike() if b - a >= shortest]
    up = np.linalg.solve(fit.D, (np.reshape(means, (-1, 3)) - fit.b_a).T).T
    return np.asarray(-up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9))
