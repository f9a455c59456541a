"""Statistical tests that extend a model: the quantile of Wald's, and lever arms of a few millimetres."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from mpucal.calibration import calibrate
from mpucal.calibration.hypothesis_tests import SCORE, WALD_99, K
from mpucal.kernel import _kernel
from tools.lab.judge import sph_rms

G = 9.82


def beside_the_pivot(run, r):
    """Return the recording of a sensor at r (3,) [m] from the point about which it turned."""
    recording = run.recording
    rate = _kernel.moving_mean((recording.gyr - run.truth.b_omega) @ run.truth.K.T, 5)
    alpha = np.gradient(rate, recording.t, axis=0)
    force = np.cross(alpha, r) + np.cross(rate, np.cross(rate, r))
    return replace(recording, acc=recording.acc + force @ run.truth.D.T)


def test_the_thresholds_are_quantiles_of_chi_squared():
    assert pytest.approx(scipy.special.chdtri(len(K.names), 0.01), rel=1e-3) == WALD_99
    assert pytest.approx(scipy.special.chdtri(3, 1e-6), rel=1e-2) == SCORE


def test_a_sensor_beside_its_pivot_is_in_a_hand(ideal):
    run = ideal(2, rate_hz=100, turn_s=3.0)
    recording = beside_the_pivot(run, [0.015, -0.01, 0.008])
    chosen, in_place = calibrate(recording, "auto", G), calibrate(recording, "imu", G)
    assert chosen.fit["model"] == "hand"
    assert "the data show a lever arm of 1" in chosen.fit["why"]
    error, without = (sph_rms(run.truth, c.D, c.b_a) for c in (chosen, in_place))
    assert error < 0.7 * without


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_at_its_pivot_is_not_in_a_hand(ideal, seed):
    for r in ([0.0, 0.0, 0.0], [3e-4, 0.0, -3e-4]):
        chosen = calibrate(beside_the_pivot(ideal(seed), r), "auto", G)
        assert chosen.fit["model"] in ("accel", "imu")
