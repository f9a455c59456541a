"""A digest by which a recording is known again: SHA-256 of its samples, whatever file it came from."""

from __future__ import annotations

import hashlib

import numpy as np

from ..data import Recording

# far below a count of any sensor, and far above what a text file rounds away [m/s^2, rad/s]
STEP = 1e-6
# beyond what any sensor measures, so that whatever a file holds has a digest
MOST = 1e12


def recording_digest(recording: Recording) -> str:
    """64 hexadecimal digits of acc and gyr; times are left out, as another reading of a clock changes them."""
    digest = hashlib.sha256()
    for values in (recording.acc, recording.gyr):
        # a gyroscope that was not measured is NaN
        measured = np.clip(np.where(np.isnan(values), 0.0, values), -MOST, MOST)
        digest.update(np.rint(measured / STEP).astype("<i8").tobytes())
    return digest.hexdigest()
