"""Evidence for a verdict, compared with the truth of the recordings."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.evidence import Evidence
from mpucal.calibration.fit import Fit
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.rests.flat import flat_statistics

G = 9.82


def exact_fit(truth, sd=1e-3):
    """Return a fit that found the truth."""
    return Fit(
        truth.D,
        truth.b_a,
        truth.b_omega,
        truth.K,
        names=D_NAMES + B_A_NAMES,
        covariance=sd**2 * np.eye(12),
        iterations=1,
        converged=True,
        nis=3.0,
        V=0.0,
    )


def evidence(recording, fit=None, flat=True):
    statistics = flat_statistics(recording, recording.flat) if flat else None
    return Evidence(recording, G, statistics, fit, "auto")


def test_calibrated_at_the_truth_the_recording_is_gravity_and_noise(ideal):
    simulated = ideal(0)
    seen = evidence(simulated.recording, exact_fit(simulated.truth))
    off = seen.calibrated - simulated.specific_force
    assert np.abs(off.mean(0)).max() < 0.01
    np.testing.assert_allclose(off.std(0), 0.08, rtol=0.1)


@pytest.mark.parametrize("broken", [{"D": np.zeros((3, 3))}, {"D": np.full((3, 3), np.nan)}], ids=["singular", "nan"])
def test_a_fit_without_a_usable_matrix_has_no_uncertainty(in_hand, broken):
    fit = replace(exact_fit(in_hand.truth), **broken)
    seen = evidence(in_hand.recording, fit)
    assert seen.uncertainty is None
    assert seen.calibrated is None


def test_the_largest_turn_of_gravity(ideal):
    simulated = ideal(0)
    recording = simulated.recording
    assert np.rad2deg(evidence(recording.part(0, 600)).gravity_moved) == pytest.approx(72.0, abs=12.0)
    assert np.rad2deg(evidence(recording).gravity_moved) > 160.0
    assert evidence(recording).gravity_moved_before == 0.0
    later = replace(recording, flat=(1800, 2000))
    assert np.rad2deg(evidence(later).gravity_moved_before) > 160.0
    assert evidence(later).gravity_moved == 0.0


@pytest.mark.parametrize("flat", [True, False], ids=["flat known", "flat not found"])
@pytest.mark.parametrize("motion", ["paper", "pose12", "continuous", "turns"])
def test_rates_in_degrees_are_distinguished_from_rates_in_radians(ideal, hand, motion, flat):
    recording = ideal(0).recording if motion == "paper" else hand(0, motion).recording
    in_degrees = replace(recording, gyr=np.rad2deg(recording.gyr))
    assert not evidence(recording, flat=flat).rates_in_degrees
    assert evidence(in_degrees, flat=flat).rates_in_degrees


def test_turns_about_the_vertical_and_noise_are_not_taken_for_degrees(in_hand):
    recording = in_hand.recording
    rng = np.random.default_rng(0)
    upright = np.tile(recording.acc[:1000], (5, 1))
    spinning = np.where(np.arange(5000)[:, None] < 1000, 0.0, [0.0, 0.0, 5.0])
    assert not evidence(replace(recording, acc=upright, gyr=recording.gyr * 0 + spinning)).rates_in_degrees
    noisy = recording.gyr + 2.0 * rng.standard_normal(recording.gyr.shape)
    assert not evidence(replace(recording, gyr=noisy)).rates_in_degrees
