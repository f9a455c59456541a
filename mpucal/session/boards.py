"""Kinds of boards, and the words for their orientations: the same in prompts, on the screen, on the page and spoken.

A person sees a chip, pins and edges; the axes stand in brackets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

from ..origin import Origin, name_thing
from ..rests.limits import LEAST_TURN_RAD
from ..result.orientation import AXES, named_axes
from .events import Direction, Output

T = TypeVar("T", bound=Output)

BOARD, PLAIN, VEHICLE = "gy-521", "plain", "vehicle"
# A board lies flat if at least this share of gravity is along its z axis.
LIES = math.cos(LEAST_TURN_RAD)
# Share of gravity along an axis from which a tilt is named after it.
TILTED = 0.15


class Kind(NamedTuple):
    """Words for a kind of board.

    Attributes
    ----------
    lay : the request to lay it flat. parts : its parts, by the axis that points there.
    flat : questions to confirm while it lies with -z and with +z down. picture : caption of the picture of how it
        should lie.
    """

    lay: str
    parts: Mapping[str, str]
    flat: tuple[str, str]
    picture: str


_EDGES = {"+X": "right edge", "−X": "left edge", "+Y": "far edge", "+Z": "chip face", "−Z": "back"}
KINDS = {
    BOARD: Kind(
        "Lay the board flat",
        {**_EDGES, "−Y": "pin edge"},
        ("Chip up, pins toward you", "Chip down, pins away from you"),
        "flat: the chip up, the pins toward you",
    ),
    PLAIN: Kind(
        "Lay the board flat",
        {**_EDGES, "−Y": "near edge"},
        ("Chip up, +Y away from you", "Chip down, +Y toward you"),
        "flat: the chip up",
    ),
    VEHICLE: Kind(
        "Put the vehicle on its feet",
        {"+X": "nose", "−X": "tail", "+Y": "right side", "−Y": "left side", "+Z": "underside", "−Z": "top"},
        ("Upside down, nose to the right", "On its feet, nose to the right"),
        "level, on its feet",
    ),
}
BOARDS = tuple(KINDS)


def usual_board(origin: Origin) -> str:
    """Return the kind of board to speak of and to draw for samples of an `origin`, unless another is named."""
    return VEHICLE if origin is Origin.VEHICLE else BOARD


def flat_description(down: Direction, board: str) -> str:
    """Return the question to confirm for a `board` whose unit vector `down` points down."""
    if abs(down[2]) < LIES:
        return "It is tilted now."
    return f"{KINDS[board].flat[down[2] > 0.0]}? Then leave it. If not, turn it."


def speak_of(output: T, board: str) -> T:
    """Return a session's output, which speaks of a board, in the words for `board`."""
    if board != VEHICLE:
        return output
    words: Any = (name_thing(each, Origin.VEHICLE) if type(each) is str else each for each in output)
    return type(output)(*words)


def describe(down: Direction, board: str) -> str:
    """Describe the orientation of a `board` whose unit vector `down` points down: "on its left edge (−X)"."""
    axes = named_axes(down)
    words = (_stand if board == VEHICLE else _lean)(axes, KINDS[board].parts)
    return f"{words} ({' '.join(axes)})"


def describe_tilt(down: Direction, board: str) -> str:
    """Describe a small tilt from level of a `board`, such as "lower at its far edge and left edge (−X +Y)"."""
    level = max(range(3), key=lambda i: abs(down[i]))
    axes = [axis for axis in named_axes(down, TILTED) if axis[1] != AXES[level]]
    if not axes:
        return "level"
    return f"lower at its {' and '.join(KINDS[board].parts[axis] for axis in axes)} ({' '.join(axes)})"


def _lean(axes: list[str], parts: Mapping[str, str]) -> str:
    """Return the words for a board: the edge or corner that it stands on, and how its chip face leans."""
    edges = [parts[axis] for axis in reversed(axes) if "Z" not in axis]
    chip = {"+Z": "down", "−Z": "up"}.get(axes[-1])
    if not edges:
        return f"chip face {chip}"
    stands = f"on its corner between {' and '.join(edges)}" if len(edges) > 1 else f"on its {edges[0]}"
    return f"{stands}, chip tilted {chip}" if chip else stands


def _stand(axes: list[str], parts: Mapping[str, str]) -> str:
    """Return the words for a vehicle, whose z axis points down in level flight."""
    sides = [parts[axis] for axis in axes if "Z" not in axis]
    tilted = f"tilted onto its {' and '.join(sides)}"
    match axes:
        case ["+Z"]:
            return "on its feet"
        case ["−Z"]:
            return "on its back"
        case ["+X" | "−X"]:
            return "nose down" if axes == ["+X"] else "nose up"
        case ["+Y" | "−Y"]:
            return f"on its {sides[0]}"
        case [*_, "+Z"]:
            return tilted
        case [*_, "−Z"]:
            return f"upside down, {tilted}"
    return f"on its {sides[1]}, tilted onto its {sides[0]}"
