"""The variance that coarse steps leave in a mean at rest."""

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.rests.flat import UNAVERAGED, rounding_variance

STEP = 0.01
COARSE = Sensor(steps=(STEP, 0.0))


@pytest.mark.parametrize(
    ("sensor", "spread", "least", "share"),
    [
        (COARSE, 0.3, UNAVERAGED, 1.0),
        (COARSE, 1.5, UNAVERAGED, UNAVERAGED),
        (COARSE, 1.5, 0.0, 0.0),
        (Sensor(), 0.0, UNAVERAGED, 0.0),
    ],
    ids=["it stays on one step", "in a hand", "on a table", "fine steps"],
)
def test_what_steps_leave_in_a_mean(sensor, spread, least, share):
    variance = np.full(3, (spread * STEP) ** 2)
    assert rounding_variance(sensor, variance, least) == pytest.approx(share * STEP**2 / 12)
