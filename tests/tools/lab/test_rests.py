"""Live and offline find the same rests, in recordings of the families."""

from itertools import pairwise

import numpy as np
import pytest

from mpucal.calibration.masks import with_masks
from mpucal.data import Sensor
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.session.meter import MotionWatch
from mpucal.session.step import HOLD_S, PauseDetector
from tools.lab.scenarios.family import drawn
from tools.lab.scenarios.table import FAMILIES

LARGEST_PART = 60  # samples


def holds(flat, parts):
    """Return the spans [s] of the holds that a session detects as these samples arrive."""
    watch, pauses, found = MotionWatch(Sensor()), PauseDetector(), {}
    watch.begin(flat.b_omega)
    # a session ignores the rest in which it begins
    pauses.leave(-1)
    for samples in parts:
        watch.add(samples)
        for pause in pauses.add(watch.sightings):
            if pause.seconds >= HOLD_S:
                found[pause.run] = (found.get(pause.run, (pause.t_s - pause.seconds,))[0], pause.t_s)
    return list(found.values())


def touched(span, others):
    return any(first < span[1] and span[0] < last for first, last in others)


def agree(name, seed):
    """Return True if each hold is a rest of the recording, and each rest of its length a hold, however samples arrive.

    None without a flat segment.
    """
    recording = with_masks(drawn(FAMILIES[name], seed).recording)
    segment = recording.flat or find_flat(recording)
    if segment is None or segment[1] == len(recording):
        return None
    flat = flat_statistics(recording, segment)
    after = recording.part(flat.last, len(recording))
    ends = np.cumsum(np.random.default_rng(seed).integers(1, LARGEST_PART, len(after)))
    parts = [after.part(first, last) for first, last in pairwise([0, *ends[ends < len(after)].tolist(), len(after)])]
    held = holds(flat, parts)
    runs = [(recording.t[a], recording.t[b - 1]) for a, b in RestFinder(recording, flat).any_hand() if a >= flat.last]
    rests = [run for run in runs if run[1] - run[0] >= HOLD_S]
    same = held == holds(flat, [after])
    return same and all(touched(hold, runs) for hold in held) and all(touched(rest, held) for rest in rests)


@pytest.mark.parametrize("name", ["poses trembling", "six poses", "phone poses", "two decimals"])
def test_the_session_and_the_recording_have_the_same_rests(name):
    assert agree(name, 100)


@pytest.mark.slow
def test_rests_agree_in_nearly_all_families():
    """Name the other families: turned slowly and evenly, carried, or slipping on the mount."""
    found = [agree(name, seed) for name in FAMILIES for seed in range(6)]
    known = [one for one in found if one is not None]
    assert len(known) > 500
    assert np.mean(known) > 0.93
