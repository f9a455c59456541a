"""Check of the gravity that a calibration refers to."""

from __future__ import annotations

from ...arguments import LEAST_ON_EARTH_MPS2, MOST_ON_EARTH_MPS2
from ...reasons import Reason, reason
from ..evidence import Evidence


def gravity_unlikely(e: Evidence) -> Reason | None:
    """A gravity that no place on Earth has, and that its caller does not stand by."""
    if e.gravity_anyway or LEAST_ON_EARTH_MPS2 <= e.gravity <= MOST_ON_EARTH_MPS2:
        return None
    least, most = LEAST_ON_EARTH_MPS2, MOST_ON_EARTH_MPS2
    return reason("gravity_unlikely", "beyond_earth", gravity=e.gravity, least=least, most=most)
