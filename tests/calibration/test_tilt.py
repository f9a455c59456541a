"""Estimator for a board that was only tilted: right within the tilts, and no claim beyond."""

from itertools import pairwise

import numpy as np
import pytest

from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.calibration.rotation import rotation
from mpucal.calibration.tilt import BIAS_SD_MPS2, SCALE_FACTOR_SD, fit_tilt
from mpucal.data import Recording
from mpucal.rests.flat import find_flat, flat_statistics

GRAVITY_MPS2 = 9.80665
RATE_HZ = 100.0
TILT_RAD = np.radians(30.0)
D = np.array([[1.02, 0.01, -0.015], [-0.012, 0.98, 0.02], [0.018, -0.01, 1.01]])
B_A = np.array([0.4, -0.3, 0.25])
B_OMEGA = np.array([0.02, -0.01, 0.03])


def tilts(angle_rad, around=8):
    """Return (k, 3) unit vectors that point up one after the other: level, then tilted to `around` sides."""
    side = np.arange(around) * 2.0 * np.pi * 3 / around
    across, along = np.sin(angle_rad), np.full(around, np.cos(angle_rad))
    return np.vstack([[0.0, 0.0, 1.0], np.stack([across * np.cos(side), across * np.sin(side), along], axis=1)])


def tilted(seed):
    """Return ten seconds flat, then a move of 1.6 s to each tilt and a rest of 2 s."""
    rng = np.random.default_rng(seed)
    ups = tilts(TILT_RAD)
    s, rate = [np.tile(ups[0], (1000, 1))], [np.zeros((1000, 3))]
    for one, other in pairwise(ups):
        axis = np.cross(one, other)
        turn = axis / np.linalg.norm(axis) * np.arccos(np.clip(one @ other, -1.0, 1.0))
        s += [rotation(np.arange(1, 161)[:, None] / 160.0 * turn) @ one, np.tile(other, (200, 1))]
        rate += [np.tile(-turn / 1.6, (160, 1)), np.zeros((200, 3))]
    path, rates = GRAVITY_MPS2 * np.vstack(s), np.vstack(rate)
    n = len(path)
    acc = path @ D.T + B_A + rng.normal(scale=0.03, size=(n, 3))
    gyr = rates + B_OMEGA + rng.normal(scale=0.002, size=(n, 3))
    return Recording.from_arrays(np.arange(n) / RATE_HZ, acc, gyr)


def fitted(recording):
    return fit_tilt(recording, flat_statistics(recording, find_flat(recording)), GRAVITY_MPS2)


@pytest.mark.parametrize("seed", range(2))
def test_errors_are_within_their_standard_deviations(seed):
    fit = fitted(tilted(seed))
    assert fit.converged
    z = np.append((fit.D - D).ravel(), fit.b_a - B_A) / fit.std(*D_NAMES, *B_A_NAMES)
    assert np.abs(z).max() < 3.5
    assert np.sqrt(np.mean(z**2)) < 1.5


def test_parameters_that_tilts_do_not_show_are_named_and_keep_their_prior():
    fit = fitted(tilted(1))
    # Near level, a gain of the vertical has the effect of its bias, and the others' gains are cosines.
    left = {name for name in fit.at_prior if name in D_NAMES + B_A_NAMES}
    assert left == {"D_xx", "D_yy", "D_zz", "b_a_z"}
    assert fit.std("D_zz")[0] > SCALE_FACTOR_SD
    assert fit.std("b_a_x")[0] < 0.15 * BIAS_SD_MPS2
