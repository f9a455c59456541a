"""Words for the orientations of boards and vehicles."""

import numpy as np
import pytest

from mpucal.session.aims import ALL_AROUND, directions
from mpucal.session.boards import BOARD, BOARDS, PLAIN, VEHICLE, describe, describe_tilt


@pytest.mark.parametrize(
    ("down", "words"),
    [
        ((0, 0, 1), {BOARD: "chip face down", VEHICLE: "on its feet"}),
        ((0, 0, -1), {BOARD: "chip face up", VEHICLE: "on its back"}),
        ((1, 0, 0), {BOARD: "on its right edge", VEHICLE: "nose down"}),
        ((-1, 0, 0), {BOARD: "on its left edge", VEHICLE: "nose up"}),
        ((0, -1, 0), {BOARD: "on its pin edge", PLAIN: "on its near edge", VEHICLE: "on its left side"}),
        ((0, -1, 1), {BOARD: "on its pin edge, chip tilted down", VEHICLE: "tilted onto its left side"}),
        ((1, 0, -1), {BOARD: "on its right edge, chip tilted up", VEHICLE: "upside down, tilted onto its nose"}),
        (
            (-1, -1, 0),
            {
                BOARD: "on its corner between pin edge and left edge",
                VEHICLE: "on its left side, tilted onto its tail",
            },
        ),
        (
            (1, 1, 1),
            {
                BOARD: "on its corner between far edge and right edge, chip tilted down",
                VEHICLE: "tilted onto its nose and right side",
            },
        ),
    ],
)
def test_an_orientation_is_described_by_things_with_the_axes_in_brackets(down, words):
    axes = " ".join(f"{'+' if v > 0 else '−'}{axis}" for v, axis in zip(down, "XYZ", strict=True) if v)
    for board, text in words.items():
        assert describe(tuple(np.array(down) / np.linalg.norm(down)), board) == f"{text} ({axes})"


@pytest.mark.parametrize("board", BOARDS)
def test_no_two_orientations_have_the_same_words(board):
    for flat, describing in ((None, describe), ((0.0, 0.0, -1.0), describe_tilt), ((0.0, 1.0, 0.0), describe_tilt)):
        asked = ALL_AROUND if flat is None else directions(flat, tilt_only=True)
        words = [describing(tuple(down), board).partition(" (")[0] for down in asked.tolist()]
        assert len(set(words)) == len(words)
