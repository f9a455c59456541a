"""The vehicle's low pass, compared with SciPy's."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from mpucal.simulated.vehicle.filter import LowPass, butterworth


@pytest.mark.parametrize(("cutoff_hz", "rate_hz"), [(10.0, 50.0), (20.0, 200.0), (188.0, 1000.0)])
def test_the_coefficients_are_those_of_a_butterworth_filter(cutoff_hz, rate_hz):
    np.testing.assert_allclose(butterworth(cutoff_hz, rate_hz), butter(2, cutoff_hz, fs=rate_hz), rtol=1e-12)


def test_each_row_is_filtered_by_its_own_cutoff():
    steps = np.random.default_rng(1).normal(size=(50, 2, 3))
    # the first one has been there for ever
    steps[0] = 0.0
    low = LowPass((20.0, 0.0), 200.0)
    found = np.array([low(step) for step in steps])
    np.testing.assert_allclose(found[:, 0], lfilter(*butter(2, 20.0, fs=200.0), steps[:, 0], axis=0), atol=1e-12)
    np.testing.assert_array_equal(found[:, 1], steps[:, 1])
