import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.rests.limits import LEAST_TURN_RAD
from mpucal.session.aims import ALL_AROUND, SPREAD, Coverage, Directions

FACES = np.vstack([np.eye(3), -np.eye(3)])
DEGENERATE = {
    "six faces": FACES,
    "a great circle": [(np.cos(a), np.sin(a), 0.0) for a in np.arange(0.0, 6.2, 0.4)],
    "a cone": [(0.8 * np.cos(a), 0.8 * np.sin(a), 0.6) for a in np.arange(0.0, 6.2, 0.5)],
    "no x-y tilt": [
        u for a in np.arange(0.0, 6.2, 0.4) for u in ((np.cos(a), 0, np.sin(a)), (0, np.cos(a), np.sin(a)))
    ],
}


def directions_of(units):
    directions = Directions()
    for unit in units:
        directions.add(np.array(unit, float))
    return directions


@pytest.mark.parametrize("units", DEGENERATE.values(), ids=DEGENERATE.keys())
def test_directions_far_from_the_held_ones_make_them_varied(units):
    coverage = Coverage()
    for unit in units:
        coverage.paused.add(np.array(unit, float))
    assert not coverage.varied
    for _ in range(8):
        coverage.paused.add(-coverage.paused.farthest_down(ALL_AROUND))
    assert coverage.varied
    assert coverage.paused.spread() > SPREAD


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_kept_directions_are_distinct_and_turning_all_changes_nothing(seed, n):
    rng = np.random.default_rng(seed)
    units = rng.normal(size=(n, 3))
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    directions = Directions()
    kept = np.array([unit for unit in units if directions.add(unit)])
    angles = np.arccos(np.clip(kept @ kept.T, -1.0, 1.0))[np.triu_indices(len(kept), 1)]
    assert (angles >= LEAST_TURN_RAD - 1e-9).all()
    assert len(directions) == len(kept)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    assert directions_of(units @ turn.T).spread() == pytest.approx(directions.spread(), abs=1e-9)
