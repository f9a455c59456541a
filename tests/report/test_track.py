from dataclasses import replace

import numpy as np
import pytest

from mpucal.report.track import Track


@pytest.fixture(scope="module")
def track(result):
    return Track(result.recording, result.calibration)


def test_at_rest_the_innovations_are_noise_about_zero(track):
    resting = track.resting[-len(track.innovations) :]
    e = track.innovations[resting]
    noise = track.calibration.noise_std
    assert len(e) > 1000
    # a hand holds it: a few times the noise of the sensor on a table
    assert (np.sqrt(np.mean(e**2, axis=0)) < 10 * noise).all()
    assert (np.abs(e.mean(axis=0)) < 0.1).all()


def test_a_wrong_calibration_shows_in_the_innovations(track):
    c = track.calibration
    wrong = Track(track.recording, replace(c, b_a=c.b_a + np.array([0.5, 0.0, 0.0])))
    rms = [np.sqrt(np.mean(t.innovations[t.resting[-len(t.innovations) :]] ** 2)) for t in (track, wrong)]
    assert rms[1] > 1.3 * rms[0]


def test_calibrated_rests_lie_on_the_sphere(track):
    before, after = (
        np.linalg.norm(track.at_rest(acc), axis=1) - track.gravity for acc in (track.recording.acc, track.calibrated)
    )
    assert len(after) >= 6
    assert np.abs(after).max() < 0.05
    assert np.abs(before).max() > 5 * np.abs(after).max()


def test_without_a_flat_segment_nothing_is_foretold(track):
    moving = track.recording.part(len(track.recording) // 2, len(track.recording) // 2 + 60)
    alone = Track(replace(moving, flat=None), track.calibration)
    assert alone.innovations is None
    assert len(alone.at_rest(alone.calibrated)) == 0
