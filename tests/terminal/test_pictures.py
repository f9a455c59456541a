"""Pictures: large letters, the board, the map of orientations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.session.attitude import rotate, straight
from mpucal.session.boards import BOARDS
from mpucal.terminal import pictures
from mpucal.terminal.view import Eye

DIRECTIONS = [
    (0, 0, -1),
    (0, 0, 1),
    (1, 0, 0),
    (-1, 0, 0),
    (0, 1, 0),
    (0, -1, 0),
    (0.58, -0.57, 0.58),
    (-0.7, 0.1, 0.7),
]


def held(down):
    return straight((-np.array(down, float) / np.linalg.norm(down)).tolist())


def test_the_board_is_never_seen_edge_on_and_the_eye_moves_no_more_than_it_must():
    eye = Eye()
    for attitude in Rotation.random(200, random_state=0).as_quat(scalar_first=True).tolist():
        eye, before = eye.moved([attitude]), eye
        axes = np.array(eye.axes)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        face = rotate(attitude, (0.0, 0.0, 1.0))
        assert abs(axes[2] @ face) >= 0.38
        assert eye == before or abs(np.array(before.axes[2]) @ face) < 0.38


def picture(kind, down, *size):
    return pictures.draw_board(kind, held(down), Eye().moved([held(down)]), *size)


def where(canvas, letter):
    rows = [line.plain for line in canvas.lines("", unicode=True)]
    return next((k, row.index(letter)) for k, row in enumerate(rows) if letter in row)


@pytest.mark.parametrize(("axis", "letter"), [(0, "X"), (1, "Y"), (2, "Z")], ids="xyz")
@pytest.mark.parametrize("size", [(22, 9), (44, 25)], ids=["small", "large"])
def test_the_letter_of_the_lowest_axis_is_below_the_others(axis, letter, size):
    for sign in (1.0, -1.0):
        down = tuple(sign if i == axis else 0.0 for i in range(3))
        canvas = picture("gy-521", down, *size)
        rows = {other: where(canvas, other)[0] for other in "XYZ"}
        others = [row for other, row in rows.items() if other != letter]
        assert (rows[letter] > max(others)) if sign > 0 else (rows[letter] < min(others))


@pytest.mark.parametrize("size", [(22, 9), (44, 20)], ids=["small", "large"])
def test_each_kind_of_board_differs_in_any_way_to_hold_it(size):
    drawn = [
        "\n".join(line.plain for line in picture(kind, down, *size).lines("", unicode=unicode))
        for kind in (BOARDS if size[1] > 10 else ("gy-521", "vehicle"))
        for unicode in (True, False)
        for down in DIRECTIONS
    ]
    assert len(set(drawn)) == len(drawn)


def test_the_map_shows_a_direction_on_its_own_half():
    marks = [("held", (0.0, 0.0, 1.0)), ("wanted", (0.9, 0.0, -0.43))]
    upper, lower = (
        [line.plain for line in pictures.draw_half(half, marks, 20, 10, unicode=False).lines("", unicode=False)]
        for half in (True, False)
    )
    assert any("o" in row for row in upper)
    assert not any("X" in row for row in upper)
    (row,) = (row for row in lower if "X" in row)
    # x is to the right.
    assert row.index("X") > 13
    assert not any("o" in row for row in lower)
