"""Rotations of the simulated hand, compared with SciPy's matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.calibration.rotation import shortest_turn
from mpucal.simulated import rotation


def matrix(q):
    """Return SciPy's rotation matrix of a quaternion (w, x, y, z)."""
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


@pytest.mark.parametrize(
    ("a", "b"),
    [
        pytest.param([0, 0, 1], [0, 0, 1], id="the same"),
        pytest.param([0, 0, 1], [0, 0, -1], id="opposite"),
        pytest.param([1, 0, 0], [-1, 0, 0], id="opposite x"),
        pytest.param([1, 0, 0], [0, 0.6, 0.8], id="across"),
        pytest.param([0, 0, 1], [0, 1e-5, 1], id="nearly the same"),
    ],
)
def test_the_shortest_turn(a, b):
    a, b = (np.array(v) / np.linalg.norm(v) for v in (a, b))
    turn = shortest_turn(a, b)
    np.testing.assert_allclose(matrix(rotation.exp(turn)) @ a, b, atol=1e-9)
    assert np.linalg.norm(turn) == pytest.approx(np.arccos(np.clip(a @ b, -1, 1)), abs=1e-7)
