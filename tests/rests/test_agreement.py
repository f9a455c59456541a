"""Rests that the session accepts are found by the verification, for a hand with any tremor."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration.verification import LEAST_REST_S
from mpucal.data import Recording, Sensor
from mpucal.rests.flat import flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.session.meter import MotionWatch
from mpucal.session.step import HOLD_S, PauseDetector
from tools.lab.scenarios.body import attitudes, board_from_world

RATE_HZ, FLAT_S, MOVE_S, GRAVITY_MPS2 = 100.0, 6.0, 1.0, 9.81


def held_in_a_hand(tremor_rad_s, hertz, holds_s, seed):
    """Return a board on a table, then turned by 60 degrees and held repeatedly; and the begin of each hold."""
    rng = np.random.default_rng(seed)
    omega, starts = [np.zeros((int(FLAT_S * RATE_HZ), 3))], []
    for hold_s in holds_s:
        n = int(MOVE_S * RATE_HZ)
        axis = rng.standard_normal(3)
        speed = np.radians(60.0) * (1.0 - np.cos(2.0 * np.pi * np.arange(n) / n))
        omega.append(np.outer(speed, axis / np.linalg.norm(axis)))
        starts.append(sum(map(len, omega)))
        t = np.arange(int(hold_s * RATE_HZ)) / RATE_HZ
        phase = rng.uniform(0.0, 2.0 * np.pi, 3)
        omega.append(np.sqrt(2.0) * tremor_rad_s * np.sin(2.0 * np.pi * hertz * t[:, None] + phase))
    omega.append(omega[1])
    rates = np.concatenate(omega)
    up = board_from_world(attitudes(rates, 1.0 / RATE_HZ))[:-1, :, 2]
    acc = GRAVITY_MPS2 * up + 0.02 * rng.standard_normal(up.shape)
    gyr = rates + 0.002 * rng.standard_normal(rates.shape)
    t = np.arange(len(acc)) / RATE_HZ
    return Recording.from_arrays(t, acc, gyr, flat=(0, int((FLAT_S - 1.0) * RATE_HZ))), starts


@settings(max_examples=25)
@given(
    tremor_dps=st.floats(0.0, 4.0),
    hertz=st.floats(4.0, 12.0),
    holds_s=st.lists(st.floats(1.5, 3.0), min_size=2, max_size=3),
    seed=st.integers(0, 2**32 - 1),
)
def test_an_accepted_rest_is_found_by_the_verification(tremor_dps, hertz, holds_s, seed):
    recording, starts = held_in_a_hand(np.radians(tremor_dps), hertz, holds_s, seed)
    watch, pauses = MotionWatch(Sensor()), PauseDetector()
    watch.begin(np.zeros(3))
    paused = {}
    for first in range(recording.flat[1], len(recording), 20):
        watch.add(recording.part(first, first + 20))
        for pause in pauses.add(watch.sightings):
            if pause.seconds >= HOLD_S:
                paused[pause.run] = pause.t_s
    runs = RestFinder(recording, flat_statistics(recording, recording.flat)).any_hand()
    long = recording.t[runs[runs[:, 1] - runs[:, 0] >= LEAST_REST_S * RATE_HZ]]
    for t_s in paused.values():
        assert any(first <= t_s <= last + HOLD_S for first, last in long), (paused, long)
    # Enough holds must be accepted; the first one teaches the tremor of a hand that trembles strongly.
    assert len(paused) >= len(starts) - (tremor_dps > 3.0)
