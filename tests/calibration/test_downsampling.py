from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.downsampling import downsampled
from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics


def recording_of(n, rate_hz=200.0):
    rng = np.random.default_rng(0)
    return Recording.from_arrays(np.arange(n) / rate_hz, rng.standard_normal((n, 3)), rng.standard_normal((n, 3)))


@pytest.mark.parametrize("flat", [(0, 400), (3, 401), (10, 402), (0, 403)], ids=str)
def test_blocks_are_means_and_none_holds_both_rest_and_move(flat):
    recording = recording_of(1003)
    thin, (first, last) = downsampled(recording, flat_statistics(recording, flat), 50.0)
    assert thin.rate_hz == pytest.approx(50.0)
    boundary = recording.t[flat[1]]
    # Block `last` is the first in motion.
    assert thin.t[last - 1] < boundary < thin.t[last]
    np.testing.assert_allclose(thin.acc[last], recording.acc[flat[1] : flat[1] + 4].mean(0))
    np.testing.assert_allclose(thin.gyr[last - 1], recording.gyr[flat[1] - 4 : flat[1]].mean(0))
    assert thin.t[first] >= recording.t[flat[0]]
    assert last - first == (flat[1] - flat[0]) // 4


def test_a_block_with_a_marked_sample_is_marked():
    recording = recording_of(1000)
    marks = np.zeros(1000, bool)
    marks[[401, 777]] = True
    marked = replace(recording, gap=marks, acc_clipped=marks, gyr_clipped=marks)
    thin, _ = downsampled(marked, flat_statistics(recording, (0, 400)), 50.0)
    for name in ("gap", "acc_clipped", "gyr_clipped"):
        assert np.flatnonzero(getattr(thin, name)).tolist() == [100, 194]


@pytest.mark.parametrize("rate_hz", [50.0, 60.0, 20.0])
def test_a_slow_recording_stays_as_it_is(rate_hz):
    recording = recording_of(1000, rate_hz)
    thin, flat = downsampled(recording, flat_statistics(recording, (5, 300)), 50.0)
    assert thin is recording
    assert flat == (5, 300)
