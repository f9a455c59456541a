"""Estimator for a board that was only tilted: right within the tilts, and uncertain elsewhere."""

import numpy as np
import pytest

from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.calibration.rotation import shortest_turns
from mpucal.calibration.tilt import BIAS_SD_MPS2, D_SD, fit_tilt
from mpucal.rests.flat import flat_statistics
from tools.lab.scenarios.course import Leg, along
from tools.lab.scenarios.family import Family, simulate
from tools.lab.scenarios.sensors import Chip, Sampling
from tools.lab.scenarios.table import STEADY

# up in the board: level, then tilted by 30 deg to eight sides
SIDES = np.arange(8) * 2.0 * np.pi * 3 / 8
TILTED = np.stack([0.5 * np.cos(SIDES), 0.5 * np.sin(SIDES), np.full(8, np.sqrt(0.75))], axis=1)
UPS = np.vstack([[0.0, 0.0, 1.0], TILTED])
LEGS = [Leg(turn, 1.6, 2.0) for turn in shortest_turns(UPS[1:], UPS[:-1])]
BOARD = Family(
    "tilted",
    motion=lambda step_s, rng: along(LEGS, step_s),
    hand=STEADY,
    chip=Chip(gyro_gain=0.0, gyro_cross=0.0),
    sampling=Sampling(100.0),
    flat_known=True,
    lying_deg=0.0,
)


def fitted(seed):
    """Return the fit of a drawn sensor on the board, and its truth."""
    made = simulate(BOARD, np.random.default_rng(seed))
    flat = flat_statistics(made.recording, made.recording.flat)
    return fit_tilt(made.recording, flat, made.truth.gravity), made.truth


@pytest.mark.parametrize("seed", range(2))
def test_errors_are_within_their_standard_deviations(seed):
    fit, truth = fitted(seed)
    assert fit.converged
    z = np.append((fit.D - truth.D).ravel(), fit.b_a - truth.b_a) / fit.std(*D_NAMES, *B_A_NAMES)
    assert np.abs(z).max() < 3.5
    assert np.sqrt(np.mean(z**2)) < 1.5


def test_parameters_that_tilts_do_not_show_are_named_and_keep_their_prior():
    fit, _ = fitted(1)
    # Near level, a gain of the vertical has the effect of its bias, and the others' gains are cosines.
    left = {name for name in fit.at_prior if name in D_NAMES + B_A_NAMES}
    assert left == {"D_xx", "D_yy", "D_zz", "b_a_z"}
    assert fit.std("D_zz")[0] > D_SD
    assert fit.std("b_a_x")[0] < 0.15 * BIAS_SD_MPS2
