from dataclasses import replace

import numpy as np
import pytest

from mpucal.report.track import Track


@pytest.fixture(scope="module")
def track(result):
    return Track(result.recording, result.calibration)


def test_a_wrong_calibration_shows_in_the_innovations(track):
    c = track.calibration
    wrong = Track(track.recording, replace(c, b_a=c.b_a + np.array([0.5, 0.0, 0.0])))
    rms = [np.sqrt(np.mean(t.innovations[t.resting[-len(t.innovations) :]] ** 2)) for t in (track, wrong)]
    assert rms[1] > 1.3 * rms[0]


def test_without_a_flat_segment_nothing_is_foretold(track):
    moving = track.recording.part(len(track.recording) // 2, len(track.recording) // 2 + 60)
    alone = Track(replace(moving, flat=None), track.calibration)
    assert alone.innovations is None
    assert len(alone.at_rest(alone.calibrated)) == 0
