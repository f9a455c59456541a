"""Low pass of the vehicle, compared with SciPy's."""

import numpy as np
import scipy

from mpucal.simulated.vehicle.ardupilot import LowPass


def test_each_row_is_filtered_by_its_own_cutoff():
    steps = np.random.default_rng(1).normal(size=(49, 2, 3))
    # the filter starts in the steady state of the first one
    steps[0] = 0.0
    expected = scipy.signal.lfilter(*scipy.signal.butter(2, 20.0, fs=200.0), steps[:, 0], axis=0)
    low = LowPass((20.0, 0.0), 200.0)
    found = np.concatenate([low(steps[begin : begin + 7]) for begin in range(0, 49, 7)])
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(found[:, 1], steps[:, 1])
