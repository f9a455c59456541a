"""Check of the gravity that a calibration refers to."""

from __future__ import annotations

from ...reasons import Reason, reason
from ..evidence import Evidence

# From the equator's mountains to the poles, in round numbers (GRS 80: 9.780 and 9.832 at sea level) [m/s^2].
LEAST_MPS2, MOST_MPS2 = 9.76, 9.84


def gravity_unlikely(e: Evidence) -> Reason | None:
    """A gravity that no place on Earth has, and that its caller does not stand by."""
    if e.gravity_anyway or LEAST_MPS2 <= e.gravity <= MOST_MPS2:
        return None
    return reason("gravity_unlikely", "beyond_earth", gravity=e.gravity, least=LEAST_MPS2, most=MOST_MPS2)
