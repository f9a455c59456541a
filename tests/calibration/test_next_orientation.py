"""The next orientation of an estimate that is no number."""

from dataclasses import replace

import numpy as np

from mpucal.calibration.interim import interim_estimate
from mpucal.calibration.next_orientation import next_orientation
from mpucal.rests.flat import find_flat, flat_statistics


def test_of_an_estimate_that_diverged_some_direction_is_next(in_hand):
    recording = in_hand.recording.part(0, 2000)
    flat = flat_statistics(recording, find_flat(recording))
    known = interim_estimate(recording, flat, 9.82, None)
    diverged = replace(known, theta=replace(known.theta, u=np.full(3, np.nan)))
    assert next_orientation(diverged, np.ones(12), np.vstack([np.eye(3), -np.eye(3)])) == 0
